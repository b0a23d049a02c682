#include <volume/import/header_text.h>
#include <volume/import/source.h>

#include <base/inputs.h>
#include <base/split.h>
#include <base/utf8.h>

#include <algorithm>
#include <cctype>
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
        const auto value = base::numberIn<T>(token);
        refuseIf(!value || !std::isfinite(static_cast<double>(*value)) || out.size() > 100, file,
                 "{}: '{}' is not a list of numbers: its header is wrong, save it again", what, text.substr(0, 60));
        out.push_back(*value);
    }
    return out;
}

// Bytes of the UTF-8 character that begins at `at`; 0 where none does.
std::size_t utf8Length(std::string_view text, std::size_t at)
{
    for (std::size_t length = 1; length <= std::min<std::size_t>(4, text.size() - at); ++length) {
        if (base::isUtf8(text.substr(at, length))) {
            return length;
        }
    }
    return 0;
}

}  // namespace

std::string printable(const std::string& text)
{
    std::string out;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t length = utf8Length(text, at);
        const auto code = static_cast<unsigned char>(text[at]);
        const bool control = code < 0x20 || code == 0x7f || (length == 0 && code < 0xa0) ||
                             (length == 2 && code == 0xc2 && static_cast<unsigned char>(text[at + 1]) < 0xa0);
        if (control) {
            out += ' ';
        } else if (length == 0) {
            out += static_cast<char>(0xc0 | (code >> 6));
            out += static_cast<char>(0x80 | (code & 0x3f));
        } else {
            out += text.substr(at, length);
        }
        at += std::max<std::size_t>(1, length);
    }
    return out;
}

std::string trimmed(const std::string& text)
{
    return std::string(base::trimmed(text));
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
    refuseIf(values.size() != 1, file, "{}: '{}' must be one whole number: its header is wrong, save it again", what,
             text.substr(0, 60));
    return values[0];
}

std::filesystem::path besides(const std::filesystem::path& header, const std::string& name,
                              std::vector<std::string>& warnings)
{
    const std::string shown = name.substr(0, 200);
    refuseIf(name.size() > 4000, header, "its data file {} is not there: put it beside the header", shown);
    const std::filesystem::path data = header.parent_path() / name;
    const std::string why = base::whyNoFile(data);
    if (why.empty()) {
        return data;
    }
    // As FDA ships its VICTRE phantoms.
    const std::filesystem::path packed = data.string() + ".gz";
    std::error_code error;
    if (!std::filesystem::exists(std::filesystem::symlink_status(data, error)) && base::whyNoFile(packed).empty()) {
        warnings.push_back(fmt::format("its data file {} is not there: {}.gz beside it is read", shown, shown));
        return packed;
    }
    refuseIf(!std::filesystem::exists(std::filesystem::symlink_status(data, error)), header,
             "its data file {} is not there: put it beside the header", shown);
    refuse(header, "its data file {} {}", shown, why);
}

}  // namespace palpate::volume
