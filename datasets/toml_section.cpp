#include <datasets/toml_section.h>

#include <base/error.h>
#include <base/inputs.h>
#include <base/mapped.h>
#include <base/nearest.h>
#include <volume/direction.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

namespace palpate::datasets {

namespace {

std::string_view kind(const toml::node& node)
{
    switch (node.type()) {
        case toml::node_type::string:
            return "text";
        case toml::node_type::integer:
        case toml::node_type::floating_point:
            return "a number";
        case toml::node_type::boolean:
            return "true or false";
        case toml::node_type::array:
            return "a list";
        case toml::node_type::table:
            return "a table";
        default:
            return "a date or time";
    }
}

std::string valueText(const toml::node& node)
{
    if (const auto* s = node.as_string()) {
        return tomlString(s->get());
    }
    if (const auto* i = node.as_integer()) {
        return fmt::format("{}", i->get());
    }
    if (const auto* f = node.as_floating_point()) {
        return fmt::format("{}", f->get());
    }
    if (const auto* b = node.as_boolean()) {
        return b->get() ? "true" : "false";
    }
    if (const auto* a = node.as_array()) {
        std::string out = "[";
        for (const toml::node& n : *a) {
            out += (out.size() > 1 ? ", " : "") + valueText(n);
        }
        return out + "]";
    }
    return node.is_table() ? "{..}" : "a date or time";
}

}  // namespace

std::string tomlString(std::string_view text)
{
    std::string out = "\"";
    for (const char c : text) {
        const auto code = static_cast<unsigned char>(c);
        if (c == '"' || c == '\\') {
            out += '\\';
            out += c;
        } else if (code < 0x20 || code == 0x7F) {
            out += fmt::format("\\u{:04X}", code);
        } else {
            out += c;
        }
    }
    return out + "\"";
}

toml::table parseToml(std::string_view text, const std::string& file)
{
    try {
        return toml::parse(text, file);
    } catch (const toml::parse_error& e) {
        throw base::error("{}:{}: not TOML: {}", file, e.source().begin.line, e.description());
    }
}

std::string readText(const std::filesystem::path& file)
{
    base::checkTable(file, "a settings file");
    std::optional<std::string> text = base::contentOf(file);
    base::failIf(!text, "{}: cannot be read: check its permissions", file.native());
    return *std::move(text);
}

Section::Section(const toml::table& table, std::string file, std::string title)
    : table_(&table), file_(std::move(file)), title_(std::move(title))
{
}

const toml::node* Section::find(std::string_view key)
{
    known_.emplace(key);
    return table_->get(key);
}

std::string Section::where(const toml::node& node, std::string_view key) const
{
    return fmt::format("{}:{}: {}{}{}", file_, node.source().begin.line, title_, title_.empty() ? "" : " ", key);
}

std::string Section::place(std::string_view key) const
{
    const toml::node* node = table_->get(key);
    return node == nullptr || file_.empty() ? place() : fmt::format("{}:{}", file_, node->source().begin.line);
}

std::string Section::place() const
{
    return file_.empty() ? "" : fmt::format("{}:{}", file_, table_->source().begin.line);
}

void Section::refuse(std::string_view key, std::string_view what, std::string_view unit) const
{
    const toml::node* node = table_->get(key);
    if (node == nullptr) {
        missing(key, what);
    }
    const bool scalar = node->is_number() && !unit.empty();
    throw base::error("{} = {}{}{}: {}", where(*node, key), valueText(*node), scalar ? " " : "",
                      scalar ? unit : std::string_view(), what);
}

void Section::missing(std::string_view key, std::string_view what) const
{
    throw base::error("{} is missing{}{}{}", where(*table_, key), what.empty() ? "" : " (", what, what.empty() ? "" : ")");
}

double Section::numberOf(const toml::node& node, std::string_view key, std::string_view unit) const
{
    const std::optional<double> value = node.is_number() ? node.value<double>() : std::nullopt;
    refuseIf(!value, key, fmt::format("expected a number{}{}, found {}", unit.empty() ? "" : " in ", unit, kind(node)));
    refuseIf(!std::isfinite(*value), key, "must be a finite number", unit);
    return *value;
}

std::optional<double> Section::number(std::string_view key, std::string_view unit, double low, double high)
{
    const toml::node* node = find(key);
    if (node == nullptr) {
        return std::nullopt;
    }
    const double value = numberOf(*node, key, unit);
    if (value < low || value > high) {
        refuse(key, fmt::format("must be {:g} to {:g}{}{}", low, high, unit.empty() ? "" : " ", unit), unit);
    }
    return value;
}

std::optional<std::int64_t> Section::integer(std::string_view key, std::string_view unit, std::int64_t low,
                                             std::int64_t high)
{
    const toml::node* node = find(key);
    if (node == nullptr) {
        return std::nullopt;
    }
    refuseIf(!node->is_integer(), key,
             fmt::format("expected a whole number, found {}", node->is_number() ? "a fraction" : kind(*node)), unit);
    const std::int64_t value = node->as_integer()->get();
    if (value < low || value > high) {
        refuse(key, fmt::format("must be {} to {}{}{}", low, high, unit.empty() ? "" : " ", unit), unit);
    }
    return value;
}

std::optional<bool> Section::flag(std::string_view key)
{
    const toml::node* node = find(key);
    if (node == nullptr) {
        return std::nullopt;
    }
    refuseIf(!node->is_boolean(), key, fmt::format("expected true or false, found {}", kind(*node)));
    return node->as_boolean()->get();
}

std::optional<std::string> Section::word(std::string_view key)
{
    const toml::node* node = find(key);
    if (node == nullptr) {
        return std::nullopt;
    }
    refuseIf(!node->is_string(), key, fmt::format("expected text in quotes, found {}", kind(*node)));
    refuseIf(node->as_string()->get().empty(), key, "must not be empty");
    return node->as_string()->get();
}

std::vector<std::string> Section::words(std::string_view key)
{
    std::vector<std::string> out;
    const toml::node* const list = find(key);
    refuseIf(list != nullptr && !list->is_array(), key, "must be a list of texts in quotes");
    for (std::size_t i = 0; list != nullptr && i < list->as_array()->size(); ++i) {
        const auto text = list->as_array()->get(i)->value_exact<std::string>();
        refuseIf(!text || text->empty(), key, "must be a list of texts in quotes, none of them empty");
        out.push_back(*text);
    }
    return out;
}

std::optional<std::size_t> Section::choice(std::string_view key, std::span<const std::string_view> choices)
{
    const std::optional<std::string> value = word(key);
    if (!value) {
        return std::nullopt;
    }
    const auto at = std::find(choices.begin(), choices.end(), *value);
    if (at == choices.end()) {
        refuse(key, fmt::format("must be one of {}", fmt::join(choices, ", ")));
    }
    return static_cast<std::size_t>(at - choices.begin());
}

std::optional<Vec3> Section::point(std::string_view key, double limit)
{
    const toml::node* node = find(key);
    if (node == nullptr) {
        return std::nullopt;
    }
    const toml::array* list = node->as_array();
    refuseIf(list == nullptr || list->size() != 3, key,
             fmt::format("expected three numbers in mm: [x, y, z], found {}",
                         list == nullptr ? std::string(kind(*node)) : fmt::format("{} of them", list->size())));
    Vec3 p(0.0);
    for (int axis = 0; axis < 3; ++axis) {
        p[axis] = numberOf(*list->get(static_cast<std::size_t>(axis)), key, "mm") * 1e-3;
        if (std::abs(p[axis]) > limit * 1e-3) {
            refuse(key, fmt::format("each must be {:g} to {:g} mm", -limit, limit));
        }
    }
    return p;
}

std::optional<Vec3> Section::direction(std::string_view key, double limit)
{
    const auto given = point(key, limit);
    if (!given) {
        return std::nullopt;
    }
    const Vec3 way = volume::rescaled(*given);
    refuseIf(!(glm::length(way) > 0), key, "a direction must not be [0, 0, 0]");
    return glm::normalize(way);
}

std::optional<Section> Section::section(std::string_view key)
{
    const toml::node* node = find(key);
    if (node == nullptr) {
        return std::nullopt;
    }
    const toml::table* table = node->as_table();
    refuseIf(table == nullptr, key, fmt::format("expected a table [{}], found {}", key, kind(*node)));
    const std::string path = path_.empty() ? std::string(key) : fmt::format("{}.{}", path_, key);
    Section inner(*table, file_, fmt::format("[{}]", path));
    inner.path_ = path;
    return inner;
}

std::vector<Section> Section::sections(std::string_view key)
{
    std::vector<Section> out;
    const toml::node* node = find(key);
    if (node == nullptr) {
        return out;
    }
    const toml::array* list = node->as_array();
    refuseIf(list == nullptr, key, fmt::format("expected a list of tables [[{}]], found {}", key, kind(*node)));
    for (const toml::node& n : *list) {
        refuseIf(!n.is_table(), key, fmt::format("expected a list of tables [[{}]], found {} in it", key, kind(n)));
        out.emplace_back(*n.as_table(), file_, fmt::format("[[{}]]", key));
    }
    return out;
}

std::vector<std::string> Section::keys() const
{
    return base::mapped<std::string>(*table_, [](const auto& entry) { return entry.first.str(); });
}

void Section::finish() const
{
    for (const auto& [key, node] : *table_) {
        if (known_.contains(key.str())) {
            continue;
        }
        const auto nearer = [&](const std::string& a, const std::string& b) {
            return base::editDistance(key.str(), a) < base::editDistance(key.str(), b);
        };
        const auto nearest = std::min_element(known_.begin(), known_.end(), nearer);
        const std::string hint = nearest == known_.end() ? "" : fmt::format("; did you mean {}?", *nearest);
        throw base::error("{}: unknown key{}", where(node, key.str()), hint);
    }
}

}  // namespace palpate::datasets
