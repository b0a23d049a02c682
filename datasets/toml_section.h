#pragma once

#include <volume/geometry.h>

#include <toml++/toml.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::datasets {

/// Parses TOML text. Throws std::runtime_error ("FILE:LINE: not TOML: ..").
toml::table parseToml(std::string_view text, const std::string& file);

/// The text of a file. Throws std::runtime_error when it cannot be read or is over 16 MB.
std::string readText(const std::filesystem::path& file);

/// One table of a TOML file. It remembers the keys that were asked for, so that finish() can refuse the others.
/// Every error is a std::runtime_error of the form "FILE:12: [dffb] range_mm = -4 mm: must be 0 to 100 mm".
class Section {
public:
    /// `title` stands before the key in errors: "[dffb]", "tissue 'fat':"; empty at the top of a file.
    Section(const toml::table& table, std::string file, std::string title);

    /// A finite number from `low` to `high`, in `unit`.
    std::optional<double> number(std::string_view key, std::string_view unit, double low, double high);
    std::optional<std::int64_t> integer(std::string_view key, std::string_view unit, std::int64_t low, std::int64_t high);
    std::optional<bool> flag(std::string_view key);
    /// Text that is not empty.
    std::optional<std::string> word(std::string_view key);
    /// The texts of a list, none of them empty; no text where the key is missing.
    std::vector<std::string> words(std::string_view key);
    /// Index of the value in `choices`.
    std::optional<std::size_t> choice(std::string_view key, std::span<const std::string_view> choices);
    /// Three numbers in mm, as metres; each within `limit` mm of 0.
    std::optional<Vec3> point(std::string_view key, double limit);
    /// A direction of any length but 0, as point(): the unit vector.
    std::optional<Vec3> direction(std::string_view key, double limit);
    /// A table inside this one; its title is "[outer.key]".
    std::optional<Section> section(std::string_view key);
    /// The tables of an array; titles "[[key]]".
    std::vector<Section> sections(std::string_view key);

    /// The value of a key as it stands, or null.
    const toml::node* node(std::string_view key) { return find(key); }
    /// All keys of the table.
    std::vector<std::string> keys() const;
    bool has(std::string_view key) const { return table_->contains(key); }
    /// "FILE:LINE" of a key, and of the section itself.
    std::string place(std::string_view key) const;
    std::string place() const;
    void setTitle(std::string title) { title_ = std::move(title); }
    /// Refuses the value of `key`.
    [[noreturn]] void refuse(std::string_view key, std::string_view what, std::string_view unit = {}) const;
    void refuseIf(bool wrong, std::string_view key, std::string_view what, std::string_view unit = {}) const
    {
        if (wrong) {
            refuse(key, what, unit);
        }
    }
    /// Says that `key` is missing.
    [[noreturn]] void missing(std::string_view key, std::string_view what) const;
    void missingIf(bool wrong, std::string_view key, std::string_view what) const
    {
        if (wrong) {
            missing(key, what);
        }
    }
    /// Refuses keys that nobody asked for, with the nearest of those that were.
    void finish() const;

private:
    const toml::node* find(std::string_view key);
    std::string where(const toml::node& node, std::string_view key) const;
    double numberOf(const toml::node& node, std::string_view key, std::string_view unit) const;

    const toml::table* table_;
    std::string file_;
    std::string title_;
    std::string path_;  // of the table, "dffb.surgery"
    std::set<std::string, std::less<>> known_;
};

/// A string as TOML writes it, quoted and escaped.
std::string tomlString(std::string_view text);

}  // namespace palpate::datasets
