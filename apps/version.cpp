#include <apps/version.h>

#include <base/build.h>
#include <chainmail/kernels_sets.h>

#include <bzlib.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <libusb-1.0/libusb.h>
#include <openssl/crypto.h>
#include <openvdb/version.h>
#include <sqlite3.h>
#include <tbb/version.h>
#include <toml++/toml.h>
#include <zlib.h>
#include <CLI/Version.hpp>
#include <boost/version.hpp>
#include <nlohmann/json.hpp>
#ifdef PALPATE_DICOM
#include <dcmtk/config/osconfig.h>
#include <openjpeg.h>
#endif
#ifdef PALPATE_SWEEP
#include <muParser.h>
#endif

#include <array>
#include <string_view>
#include <vector>

namespace palpate::apps {

namespace {

std::string usbVersion()
{
    const libusb_version* v = libusb_get_version();
    return fmt::format("{}.{}.{}", v->major, v->minor, v->micro);
}

// "1.0.8, 13-Jul-2019" and the like, without what follows the number.
std::string numberOf(std::string_view text)
{
    return std::string(text.substr(0, text.find_first_of(", (")));
}

std::vector<std::string> libraries()
{
    std::vector<std::string> all{
        fmt::format("OpenVDB {}", openvdb::getLibraryVersionString()),
        fmt::format("TBB {}", TBB_runtime_version()),
        fmt::format("SQLite {}", sqlite3_libversion()),
        fmt::format("OpenSSL {}", OpenSSL_version(OPENSSL_VERSION_STRING)),
        fmt::format("libusb {}", usbVersion()),
        fmt::format("zlib {}", zlibVersion()),
        fmt::format("bzip2 {}", numberOf(BZ2_bzlibVersion())),
        fmt::format("Boost {}.{}", BOOST_VERSION / 100000, BOOST_VERSION / 100 % 1000),
        fmt::format("fmt {}.{}.{}", FMT_VERSION / 10000, FMT_VERSION / 100 % 100, FMT_VERSION % 100),
        fmt::format("toml++ {}.{}.{}", TOML_LIB_MAJOR, TOML_LIB_MINOR, TOML_LIB_PATCH),
        fmt::format("nlohmann-json {}.{}.{}", NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR,
                    NLOHMANN_JSON_VERSION_PATCH),
        fmt::format("CLI11 {}", CLI11_VERSION),
    };
#ifdef PALPATE_DICOM
    all.push_back(fmt::format("DCMTK {}", PACKAGE_VERSION));
    all.push_back(fmt::format("OpenJPEG {}", opj_version()));
#endif
#ifdef PALPATE_SWEEP
    all.push_back(fmt::format("muParser {}", numberOf(mu::ParserVersion)));
#endif
    return all;
}

}  // namespace

std::string versionText()
{
    using namespace chainmail;
    const std::array built{kernelsV2.name, kernelsAvx2.name, kernelsAvx512.name};
    std::vector<std::string_view> runs;
    for (const Kernels* set : supportedKernels()) {
        runs.emplace_back(set->name);
    }
    return fmt::format("{}\ncompiler   {} {}\nkernels    {} (this machine runs {})\nlibraries  {}", base::build(),
#ifdef __clang__
                       "clang",
#else
                       "GCC",
#endif
                       numberOf(__VERSION__), fmt::join(built, ", "), fmt::join(runs, ", "), fmt::join(libraries(), ", "));
}

}  // namespace palpate::apps
