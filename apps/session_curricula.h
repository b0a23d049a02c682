#pragma once

#include <training/curriculum.h>

#include <fmt/format.h>

#include <cstdio>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace palpate::apps {

/// Curricula that sessions name, read once: what is returned points to them. One that is missing is a warning, once.
class Curricula {
public:
    /// One that was asked for has to be there. Returns its name.
    std::string add(const std::string& asked)
    {
        training::Curriculum made = training::findCurriculum(asked);
        const std::string id = made.id;
        all_.insert_or_assign(id, std::move(made));
        return id;
    }
    const training::Curriculum* called(const std::string& id)
    {
        const auto known = all_.find(id);
        if (known != all_.end()) {
            return known->second ? &*known->second : nullptr;
        }
        std::optional<training::Curriculum>& made = all_[id];
        try {
            made = training::findCurriculum(id);
        } catch (const std::runtime_error& e) {
            fmt::print(stderr, "palpate: warning: sessions of a missing curriculum are not counted: {}\n", e.what());
        }
        return made ? &*made : nullptr;
    }

private:
    std::map<std::string, std::optional<training::Curriculum>> all_;
};

}  // namespace palpate::apps
