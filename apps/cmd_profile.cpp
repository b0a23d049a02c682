#include <apps/command.h>
#include <base/counted.h>
#include <base/error.h>
#include <base/outputs.h>
#include <base/user_files.h>
#include <command/json.h>
#include <command/options.h>
#include <training/case.h>
#include <training/curriculum.h>
#include <training/store.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <memory>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;
using training::Hand;
using training::Person;
using training::ProfileStore;

struct ProfileArguments {
    fs::path profiles, output, json;
    std::string name, hand = "right", exercise, caseId, note;
    std::vector<fs::path> records;
    std::int64_t session = 0;
    int rating = 0;
    bool test = false, yes = false;
};

void make(const ProfileArguments& o)
{
    ProfileStore store(o.profiles);
    const Person person = store.add(o.name, o.hand == "left" ? Hand::left : Hand::right);
    fmt::print("{}: made, {} hand, in {}\n", person.name, nameOf(person.hand), store.file().string());
}

void changeHand(const ProfileArguments& o)
{
    ProfileStore store(o.profiles);
    store.setHand(store.find(o.name), o.hand == "left" ? Hand::left : Hand::right);
    fmt::print("{}: {} hand\n", o.name, o.hand);
}

void list(const ProfileArguments& o)
{
    const auto store = ProfileStore::toRead(o.profiles);
    const auto people = store.people();
    if (people.empty() && o.json != "-") {
        fmt::print("no profiles yet: palpate profile new NAME\n");
    }
    auto figures = nlohmann::json::array();
    for (const Person& p : people) {
        figures.push_back({{"name", p.name}, {"hand", nameOf(p.hand)}, {"created", p.created}, {"sessions", p.sessions}});
        if (o.json != "-") {
            fmt::print("{:<24} {:<6} {:>14}, since {}\n", p.name, nameOf(p.hand),
                       base::counted(static_cast<std::size_t>(p.sessions), "session"), p.created.substr(0, 10));
        }
    }
    command::writeJson(o.json, {{"file", store.file().string()}, {"profiles", figures}});
}

void exportOne(const ProfileArguments& o)
{
    const auto store = ProfileStore::toRead(o.profiles);
    const fs::path to = o.output.empty() ? fs::path("-") : o.output;
    base::checkOutputs({to}, {store.file()});
    command::writeJson(to, store.exported(store.find(o.name)));
}

void erase(const ProfileArguments& o)
{
    ProfileStore store(o.profiles);
    const Person person = store.find(o.name);
    base::failIf(!o.yes,
                 "{}: erasing cannot be undone: {} and all records; add --yes (palpate profile export keeps a copy)",
                 person.name, base::counted(static_cast<std::size_t>(person.sessions), "session"));
    const training::Erased erased = store.erase(person);
    // The window has the people of the standard file.
    std::error_code none;
    if (o.profiles.empty() || fs::equivalent(store.file(), ProfileStore::standardFile(), none)) {
        training::forgetLastPerson(base::trainerSettings(), person.name);
    }
    fmt::print("{}: erased\n", person.name);
    const auto tell = [](const std::vector<fs::path>& files, const std::string& what) {
        for (const fs::path& file : files) {
            fmt::print("{}: {}\n", what, file.string());
        }
    };
    tell(erased.elsewhere, "this record is in another folder and was not erased");
    tell(erased.shared, "this file is of another person too and was not erased");
    tell(erased.unclear, "this file cannot be read and was not erased; look whether it is of " + person.name);
    tell(erased.stuck, "this file is still there: remove it");
    if (!erased.stuck.empty()) {
        throw base::error("{}: not all files of {} could be removed", erased.stuck.front().string(), person.name);
    }
}

void backup(const ProfileArguments& o)
{
    const auto store = ProfileStore::toRead(o.profiles);
    store.backup(o.output);
    fmt::print("{}: {} profiles\n", o.output.string(), store.people().size());
}

void addRecords(const ProfileArguments& o)
{
    ProfileStore store(o.profiles);
    const Person person = store.find(o.name);
    // All are read before one is stored.
    std::vector<training::StoredSession> sessions;
    for (const fs::path& file : o.records) {
        training::StoredSession s = training::sessionOf(file);
        training::declare(s, {o.caseId, o.exercise, o.test});
        sessions.push_back(std::move(s));
    }
    for (std::size_t i = 0; i < sessions.size(); ++i) {
        const auto id = store.store(person, sessions[i]);
        fmt::print("{}: session {} of {}, total {:.0f}\n", o.records[i].string(), id, person.name,
                   sessions[i].values["total"]);
    }
}

void note(const ProfileArguments& o)
{
    ProfileStore store(o.profiles);
    store.annotate(store.find(o.name), o.session, o.note, o.rating);
    fmt::print("{}: session {} noted\n", o.name, o.session);
}

}  // namespace

void addProfile(CLI::App& app)
{
    auto o = std::make_shared<ProfileArguments>();
    CLI::App* const c = app.add_subcommand("profile", "Make, list, export, erase and back up profiles of trainees");
    c->require_subcommand(1);
    const auto sub = [&](const char* name, const char* what, bool person) {
        CLI::App* const s = c->add_subcommand(name, what);
        s->add_option("--profiles", o->profiles, "File of profiles (default: ~/.local/share/palpate/profiles.db)");
        if (person) {
            s->add_option("NAME", o->name, "Name of the profile; may be a pseudonym")->required();
        }
        return s;
    };
    CLI::App* const made = sub("new", "Make a profile", true);
    command::addChoice(*made, "--hand", o->hand, "Hand that holds the needle", {"right", "left"});
    made->final_callback([o] { make(*o); });

    CLI::App* const changed = sub("hand", "Change the hand that holds the needle", true);
    changed->add_option("HAND", o->hand, "Hand that holds the needle")->check(CLI::IsMember({"right", "left"}))->required();
    changed->final_callback([o] { changeHand(*o); });

    CLI::App* const all = sub("list", "List profiles", false);
    all->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    all->final_callback([o] { list(*o); });

    CLI::App* const exported = sub("export", "Write all data of a person, as JSON", true);
    exported->add_option("-o,--output", o->output, "File to write (default: standard output)");
    exported->final_callback([o] { exportOne(*o); });

    CLI::App* const erased = sub("erase", "Erase a person with all sessions and their records", true);
    erased->add_flag("--yes", o->yes, "Confirm; erasing cannot be undone");
    erased->final_callback([o] { erase(*o); });

    CLI::App* const copied = sub("backup", "Copy the file of all profiles", false);
    copied->add_option("FILE", o->output, "File to write; must not exist")->required();
    copied->final_callback([o] { backup(*o); });

    CLI::App* const taken = sub("add-record", "Add sessions from their records, e.g. from another machine", true);
    taken->add_option("RECORD", o->records, "Records (.db)")->required();
    taken->add_option("--case", o->caseId, "Case (default: as in the record)");
    taken->add_option("--exercise", o->exercise, "CURRICULUM/EXERCISE (default: as in the record)");
    taken->add_flag("--test", o->test, "Count the sessions as tests");
    taken->final_callback([o] { addRecords(*o); });

    CLI::App* const noted = sub("note", "Set an instructor's note and global rating of a session", true);
    noted->add_option("SESSION", o->session, "Number of the session (palpate progress NAME)")->required();
    noted->add_option("--text", o->note, "Text of the note (default: empty)")->expected(0, 1);
    noted->add_option("--rating", o->rating, "Global rating, 1 (poor) to 5 (excellent) (default: 0, none)")
        ->check(CLI::Range(0, 5));
    noted->final_callback([o] { note(*o); });
}

}  // namespace palpate::apps
