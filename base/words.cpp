#include <base/words.h>

#include <base/child_process.h>
#include <base/spoken.h>

#include <libintl.h>

#include <atomic>
#include <clocale>
#include <cstddef>
#include <cstdlib>
#include <utility>

// glibc's: a change of LANGUAGE counts from the next look on (gettext's manual, "Changing the language at runtime").
extern "C" int _nl_msg_cat_cntr;  // NOLINT

namespace palpate::base {

namespace {

namespace fs = std::filesystem;

constexpr const char* domain = "palpate";

class Comma : public std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
};

fs::path translations()
{
    const fs::path installed = programFolder().parent_path() / "share" / "locale";
    return fs::exists(installed) ? installed : fs::path(PALPATE_BUILT_LOCALE);
}

// "de" of "de_DE.UTF-8:en".
std::string firstOf(const char* variable)
{
    const char* const value = std::getenv(variable);
    const std::string all = value != nullptr ? value : "";
    return all.substr(0, all.find_first_of("_.:@"));
}

std::string asked()
{
    for (const char* variable : {"LANGUAGE", "LC_ALL", "LC_MESSAGES", "LANG"}) {
        if (const std::string found = firstOf(variable); !found.empty()) {
            return found;
        }
    }
    return "en";
}

// Aligned for mold 1.10: it starts GNU_RELRO at what is local to threads, and a program where that lies before the last
// bytes of a page ends cannot be loaded ("cannot apply additional memory protection").
alignas(std::max_align_t) thread_local bool isEnglish = false;
std::atomic<bool> chosen = false;  // a language, by useLanguage()

}  // namespace

English::English() noexcept : before_(std::exchange(isEnglish, true)) {}

English::~English()
{
    isEnglish = before_;
}

void useLanguage(const std::string& language, const fs::path& folder)
{
    chosen = true;
    const std::string wanted = language.empty() ? asked() : language;
    const bool none = wanted == "C" || wanted == "POSIX" || wanted == "en";
    ::setenv("LANGUAGE", none ? "en" : wanted.c_str(), 1);
    // gettext translates nothing in the locale "C"; that of the language need not be installed.
    std::setlocale(LC_MESSAGES, "C.UTF-8");
    ++_nl_msg_cat_cntr;
    ::bindtextdomain(domain, (folder.empty() ? translations() : folder).c_str());
    ::bind_textdomain_codeset(domain, "UTF-8");
}

std::string language()
{
    return isEnglish || !chosen ? "en" : asked();
}

const char* tr(const char* text) noexcept
{
    return isEnglish ? text : ::dgettext(domain, text);
}

std::string tr(const std::string& text)
{
    return text.empty() ? std::string() : std::string(tr(text.c_str()));
}

const char* trn(const char* one, const char* many, unsigned long count) noexcept
{
    return isEnglish ? (count == 1 ? one : many) : ::dngettext(domain, one, many, count);
}

const char* nameOfCore(std::string_view judged) noexcept
{
    return judged == "marks"  ? marked("Place and size")
           : judged == "rest" ? marked("Rest on the skin")
           : judged == "way"  ? marked("Way to the target")
           : judged == "core" ? marked("Core")
                              : marked("Touch");
}

const std::locale& numbers()
{
    static const std::locale plain = std::locale::classic(), comma(std::locale::classic(), new Comma);
    return language() == "de" ? comma : plain;
}

std::string spokenHere(std::string_view name)
{
    return tr(spoken(name));
}

}  // namespace palpate::base
