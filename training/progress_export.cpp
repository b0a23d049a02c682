#include <training/progress_page.h>

#include <base/outputs.h>
#include <base/split.h>
#include <haptics/measures.h>

#include <fmt/format.h>
#include <openssl/sha.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

namespace palpate::training {

using nlohmann::json;

namespace {

// Whether the session met its exercise's levels; nothing outside a curriculum that is there.
std::optional<bool> metOf(const PersonProgress& p, const StoredSession& s)
{
    for (const CurriculumProgress& c : p.curricula) {
        for (const ExerciseProgress& e : c.exercises) {
            if (c.curriculum->id == s.curriculum && e.exercise->id == s.exercise) {
                return meets(e.exercise->gate, s.values);
            }
        }
    }
    return std::nullopt;
}

// A cell of a table (RFC 4180). What a spreadsheet would take for a formula is text.
std::string cell(std::string text)
{
    if (!text.empty() && std::string_view("=+-@").find(text.front()) != std::string_view::npos) {
        text.insert(text.begin(), '\'');
    }
    return base::csvCell(text);
}

// A UUID of version 5: the same name, the same id (RFC 4122, 4.3). The name space is that of URLs.
std::string uuidOf(const std::string& name)
{
    constexpr std::array<unsigned char, 16> urls{0x6b, 0xa7, 0xb8, 0x11, 0x9d, 0xad, 0x11, 0xd1,
                                                 0x80, 0xb4, 0x00, 0xc0, 0x4f, 0xd4, 0x30, 0xc8};
    std::string bytes(urls.begin(), urls.end());
    bytes += name;
    std::array<unsigned char, SHA_DIGEST_LENGTH> digest{};
    SHA1(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size(), digest.data());
    digest[6] = static_cast<unsigned char>((digest[6] & 0x0F) | 0x50);
    digest[8] = static_cast<unsigned char>((digest[8] & 0x3F) | 0x80);
    std::string out;
    for (std::size_t i = 0; i < 16; ++i) {
        out += i == 4 || i == 6 || i == 8 || i == 10 ? "-" : "";
        out += fmt::format("{:02x}", digest[i]);
    }
    return out;
}

json resultOf(const StoredSession& s, std::optional<bool> met)
{
    json extensions = json::object();
    for (const auto& [key, value] : s.values) {
        if (std::isfinite(value)) {
            extensions["urn:palpate:measure:" + key] = value;
        }
    }
    json result = {{"completion", true}, {"extensions", extensions}};
    if (met) {
        result["success"] = *met;
    }
    if (const double total = valueIn(s.values, "total"); !std::isnan(total)) {
        result["score"] = {{"scaled", std::clamp(total / 100, 0.0, 1.0)}, {"raw", total}, {"min", 0}, {"max", 100}};
    }
    if (const double seconds = valueIn(s.values, "seconds"); std::isfinite(seconds)) {
        result["duration"] = fmt::format("PT{:.2f}S", seconds);
    }
    return result;
}

// A part of a urn: what may not stand in one is written as bytes in hexadecimal (RFC 3986).
std::string urnPart(std::string_view text)
{
    std::string out;
    for (const char c : text) {
        const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                           std::string_view("-._~").find(c) != std::string_view::npos;
        out += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
    return out;
}

json statement(const PersonProgress& p, const StoredSession& s)
{
    const auto met = metOf(p, s);
    const char* const verb = !met ? "completed" : *met ? "passed" : "failed";
    const std::string what = s.exercise.empty()
                                 ? "urn:palpate:case:" + urnPart(s.caseId.empty() ? s.scene : s.caseId)
                                 : "urn:palpate:exercise:" + urnPart(s.curriculum) + ":" + urnPart(s.exercise);
    json context = {{"platform", s.build},
                    {"extensions",
                     {{"urn:palpate:case", s.caseId},
                      {"urn:palpate:mode", s.test ? "test" : "practice"},
                      {"urn:palpate:guidance", s.guidance},
                      {"urn:palpate:record_sha256", s.recordSha256}}}};
    return {
        {"id", uuidOf(fmt::format("urn:palpate:session:{}:{}:{}", p.person.created, s.id, s.started))},
        {"version", "1.0.3"},
        {"actor", {{"objectType", "Agent"}, {"account", {{"homePage", "urn:palpate:profiles"}, {"name", p.person.name}}}}},
        {"verb", {{"id", std::string("http://adlnet.gov/expapi/verbs/") + verb}, {"display", {{"en", verb}}}}},
        {"object",
         {{"objectType", "Activity"},
          {"id", what},
          {"definition", {{"type", "http://adlnet.gov/expapi/activities/simulation"}, {"name", {{"en", s.scene}}}}}}},
        {"result", resultOf(s, met)},
        {"context", context},
        {"timestamp", s.started}};
}

// A line for each session; `first` has the cells before the name.
std::string linesOf(const std::vector<PersonProgress>& people, const std::string& first)
{
    std::string out;
    for (const PersonProgress& p : people) {
        for (const StoredSession& s : p.sessions) {
            const auto met = metOf(p, s);
            out += fmt::format("\n{}{},{},{},{},{},{},{},{:g},{},{},{},{},{}", first, cell(p.person.name), s.id,
                               cell(s.started), cell(s.curriculum), cell(s.exercise), cell(s.caseId),
                               s.test ? "test" : "practice", s.guidance, met ? (*met ? "yes" : "no") : "",
                               s.rating > 0 ? std::to_string(s.rating) : "", cell(s.device), cell(s.build), cell(s.record));
            for (const haptics::Measure& m : haptics::measures()) {
                const double value = valueIn(s.values, m.key);
                out += std::isfinite(value) ? fmt::format(",{:.9g}", value) : ",";
            }
        }
    }
    return out;
}

}  // namespace

void writeProgressCsv(const std::filesystem::path& file, const std::vector<PersonProgress>& people,
                      const std::vector<PeopleGroup>& groups)
{
    std::string out = groups.empty() ? "" : "group,";
    out += "name,session,started,curriculum,exercise,case,mode,guidance,met,rating,device,build,record";
    for (const haptics::Measure& m : haptics::measures()) {
        out += fmt::format(",{}", m.key);
    }
    out += linesOf(people, groups.empty() ? "" : ",");
    for (const PeopleGroup& g : groups) {
        out += linesOf(g.people, cell(g.name) + ",");
    }
    base::writeWhole(file, out + "\n");
}

void writeXapi(const std::filesystem::path& file, const std::vector<PersonProgress>& people,
               const std::vector<PeopleGroup>& groups)
{
    json statements = json::array();
    std::set<std::string> written;
    const auto write = [&](const std::vector<PersonProgress>& some) {
        for (const PersonProgress& p : some) {
            for (const StoredSession& s : p.sessions) {
                json one = statement(p, s);
                if (written.insert(one["id"]).second) {
                    statements.push_back(std::move(one));
                }
            }
        }
    };
    write(people);
    for (const PeopleGroup& g : groups) {
        write(g.people);
    }
    base::writeWhole(file, statements.dump(2, ' ', false, json::error_handler_t::replace) + "\n");
}

}  // namespace palpate::training
