#include <volume/import/header_text.h>
#include <volume/import/source.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <sstream>

namespace palpate::volume {

namespace {

template <typename T>
std::vector<T> parsed(const std::filesystem::path& file, const std::string& what, const std::string& text)
{
    std::vector<T> out;
    std::istringstream in(text);
    for (std::string token; in >> token;) {
        T value{};
        const char* first = token.data() + (token[0] == '+' ? 1 : 0);
        const auto [end, error] = std::from_chars(first, token.data() + token.size(), value);
        const bool whole = error == std::errc() && end == token.data() + token.size();
        if (!whole || !std::isfinite(static_cast<double>(value)) || out.size() > 100) {
            refuse(file, fmt::format("{}: '{}' is not a list of numbers: its header is wrong, save it again", what,
                                     text.substr(0, 60)));
        }
        out.push_back(value);
    }
    return out;
}

}  // namespace

std::string trimmed(const std::string& text)
{
    const auto first = text.find_first_not_of(" \t\r");
    return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::string lowerCase(std::string text)
{
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return text;
}

std::vector<double> numbers(const std::filesystem::path& file, const std::string& what, const std::string& text)
{
    return parsed<double>(file, what, text);
}

std::vector<std::int64_t> integers(const std::filesystem::path& file, const std::string& what, const std::string& text)
{
    return parsed<std::int64_t>(file, what, text);
}

std::int64_t integer(const std::filesystem::path& file, const std::string& what, const std::string& text)
{
    const std::vector<std::int64_t> values = integers(file, what, text);
    if (values.size() != 1) {
        refuse(file, fmt::format("{}: '{}' must be one whole number: its header is wrong, save it again", what,
                                 text.substr(0, 60)));
    }
    return values[0];
}

std::filesystem::path besides(const std::filesystem::path& header, const std::string& name)
{
    const std::filesystem::path data = header.parent_path() / name;
    std::error_code error;
    if (name.size() > 4000 || !std::filesystem::is_regular_file(data, error)) {
        refuse(header, fmt::format("its data file {} is not there: put it beside the header", name.substr(0, 200)));
    }
    return data;
}

}  // namespace palpate::volume
