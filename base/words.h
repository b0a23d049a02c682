#pragma once

#include <filesystem>
#include <locale>
#include <string>
#include <string_view>

namespace palpate::base {

/// Chooses the language of tr() for this process and those that it starts. Only messages: numbers in files keep their
/// point.
/// @param language  "de", "en"; empty: what LANGUAGE, LC_ALL, LC_MESSAGES or LANG say
/// @param folder    of the translations (.../locale); empty: beside the program, as built or installed
void useLanguage(const std::string& language = {}, const std::filesystem::path& folder = {});

/// The language in use: "en", "de". English before useLanguage(): commands have no other.
std::string language();

/// The text in the user's language (gettext); the text itself where there is none.
const char* tr(const char* text) noexcept;
/// The same for a text that is not a literal, such as a case's title; for an empty one nothing.
std::string tr(const std::string& text);
/// Of two forms of a text the one for `count` things; a language may have other forms than one and many.
const char* trn(const char* one, const char* many, unsigned long count) noexcept;
/// While it lives, this thread's words and numbers are English: for pages and tables that are English throughout.
class English {
public:
    English() noexcept;
    ~English();
    English& operator=(English&&) = delete;

private:
    bool before_;
};

/// Marks a text that is translated where it is shown.
constexpr const char* marked(const char* text) noexcept
{
    return text;
}

/// What the part `core` of a total is called, by `judged` of its figures (haptics::judgedNames).
const char* nameOfCore(std::string_view judged) noexcept;

/// Numbers as the language in use writes them.
const std::locale& numbers();

/// The name of a tissue or a structure as people say it, in the user's language. See spoken().
std::string spokenHere(std::string_view name);

}  // namespace palpate::base
