#include <channel/channel.h>
#include <channel/segment.h>
#include <tests/channel/example.h>
#include <tests/error_of.h>

#include <gtest/gtest.h>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>

#include <algorithm>
#include <fstream>
#include <functional>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace palpate::channel {
namespace {

bool listed(const std::string& session)
{
    const auto all = sessions();
    return std::find(all.begin(), all.end(), session) != all.end();
}

// Runs `action` in a forked process that keeps what it has made until it is killed.
pid_t forkAndHold(const std::function<void()>& action)
{
    int ready[2] = {};
    EXPECT_EQ(::pipe(ready), 0);
    const pid_t child = ::fork();
    if (child == 0) {
        action();
        [[maybe_unused]] const auto written = ::write(ready[1], "x", 1);
        for (;;)
            ::pause();
    }
    char byte = 0;
    EXPECT_EQ(::read(ready[0], &byte, 1), 1);
    ::close(ready[0]);
    ::close(ready[1]);
    return child;
}

void killAndReap(pid_t child)
{
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
}

pid_t leaveSegmentOfDead(const std::string& session)
{
    const pid_t child = forkAndHold([&] { new Publisher(session, smallScenery(), smallLabels()); });
    killAndReap(child);
    return child;
}

void removeSegment(const std::string& session)
{
    ::shm_unlink(segmentName(session).c_str());
}

// Whether `action` comes to its end at all.
bool ends(const std::function<void()>& action)
{
    const pid_t child = ::fork();
    if (child == 0) {
        ::alarm(10);
        action();
        ::_exit(0);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFEXITED(status);
}

// Anybody may put files into the folder of the segments. Opening a pipe for reading waits for who writes.
TEST(Session, APipeUnderItsNameHoldsNobodyUp)
{
    const std::string session = sessionNamed("pipe");
    const std::string file = segmentFolder + segmentName(session);
    ASSERT_EQ(::mkfifo(file.c_str(), 0666), 0);
    EXPECT_TRUE(ends([] { sessions(); }));
    EXPECT_TRUE(ends([&] { tests::errorOf([&] { Subscriber::attach(session); }); }));
    EXPECT_TRUE(ends([&] { tests::errorOf([&] { Publisher(session, smallScenery(), smallLabels()); }); }));
    EXPECT_TRUE(ends([&] { const Publisher other(session + "-other", smallScenery(), smallLabels()); }));
    EXPECT_NE(tests::errorOf([&] { Subscriber::attach(session); }), "");
    EXPECT_NE(tests::errorOf([&] { Publisher(session, smallScenery(), smallLabels()); }).find("somebody else"),
              std::string::npos);
    ::unlink(file.c_str());
}

// A file that looks left behind by a dead process, writable for all, and locked by the other user for as long as he likes.
TEST(Session, AnotherUsersLockedFileHoldsNobodyUp)
{
    if (::geteuid() != 0) {
        GTEST_SKIP() << "only root can be a second user";
    }
    constexpr pid_t dead = 999999999;  // no process has this number
    const std::string session = sessionNamed("other");
    const std::string name = segmentName(session) + "." + std::to_string(dead);
    const pid_t holder = forkAndHold([&] {
        [[maybe_unused]] const int user = ::setuid(65534);
        const int file = ::shm_open(name.c_str(), O_RDWR | O_CREAT, 0666);
        ::fchmod(file, 0666);
        ::flock(file, LOCK_EX);
    });
    EXPECT_TRUE(ends([&] { const Publisher mine(session, smallScenery(), smallLabels()); }));
    EXPECT_TRUE(ends([] { sessions(); }));
    struct stat status {};
    EXPECT_EQ(::stat((segmentFolder + name).c_str(), &status), 0) << "what is another user's stays";
    killAndReap(holder);
    ::shm_unlink(name.c_str());
}

TEST(Session, NamesThatCouldLeaveTheFolderAreRefused)
{
    const std::string longest(64, 'a');
    for (const std::string& good : {std::string("a"), std::string("Ward_3-bed-2"), longest})
        EXPECT_EQ(segmentName(good), "/palpate-" + good);
    for (const std::string& bad : {std::string(), std::string("a/b"), std::string("../x"), std::string("a b"),
                                   std::string("a.1"), std::string("\xc3\xa9"), longest + "a"}) {
        EXPECT_THROW(Publisher(bad, smallScenery(), smallLabels()), std::runtime_error) << bad;
        EXPECT_THROW(Subscriber::attach(bad), std::runtime_error) << bad;
    }
}

TEST(Session, OnlyItsUserMayOpenIt)
{
    const std::string session = sessionNamed("mode");
    const mode_t before = ::umask(0);
    const Publisher publisher(session, smallScenery(), smallLabels());
    ::umask(before);
    struct stat status {};
    ASSERT_EQ(::stat((segmentFolder + segmentName(session)).c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 07777U, 0600U);
}

TEST(Session, IsListedWhileItsPublisherLivesAndGoneAfterwards)
{
    const std::string session = sessionNamed("life");
    EXPECT_FALSE(Subscriber::attach(session).has_value());
    {
        const Publisher publisher(session, smallScenery(), smallLabels());
        EXPECT_TRUE(listed(session));
        EXPECT_TRUE(Subscriber::attach(session).has_value());
    }
    EXPECT_FALSE(listed(session));
    EXPECT_NE(::access((segmentFolder + segmentName(session)).c_str(), F_OK), 0);
}

TEST(Session, ALiveOneIsNotTakenOver)
{
    const std::string session = sessionNamed("two");
    Publisher publisher(session, smallScenery(), smallLabels());
    publisher.setState(stateOf(7));
    const std::string message = tests::errorOf([&] { Publisher(session, smallScenery(), smallLabels()); });
    EXPECT_NE(message.find("running already (pid " + std::to_string(::getpid()) + ")"), std::string::npos) << message;
    const auto subscriber = Subscriber::attach(session);
    ASSERT_TRUE(subscriber);
    EXPECT_EQ(subscriber->state()->tick, 7U);
}

TEST(Session, OfAKilledProcessIsNeitherListedNorAttachedToAndIsTakenOver)
{
    const std::string session = sessionNamed("killed");
    const pid_t child = forkAndHold([&] { new Publisher(session, smallScenery(), smallLabels()); });
    auto subscriber = Subscriber::attach(session);
    ASSERT_TRUE(subscriber);
    EXPECT_EQ(subscriber->ownerPid(), static_cast<std::uint64_t>(child));
    EXPECT_EQ(subscriber->ending(), Ending::none);

    ::kill(child, SIGKILL);
    siginfo_t info{};
    ::waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | WNOWAIT);
    EXPECT_EQ(subscriber->ending(), Ending::killed) << "dead, but not yet waited for";
    ::waitpid(child, nullptr, 0);
    EXPECT_EQ(subscriber->ending(), Ending::killed);
    EXPECT_FALSE(listed(session));
    EXPECT_FALSE(Subscriber::attach(session).has_value());

    const Publisher next(session, smallScenery(), smallLabels());
    EXPECT_TRUE(listed(session));
    EXPECT_EQ(subscriber->ending(), Ending::killed) << "the new session is another one";
}

bool inMemory(const std::string& name)
{
    return ::access((segmentFolder + name).c_str(), F_OK) == 0;
}

// Also one that died before it had a header, known by the process in its temporary name.
TEST(Session, OfAnyNameThatAKilledProcessHasLeftIsRemovedByTheNextPublisher)
{
    const std::string dead = segmentName(sessionNamed("dead")), living = segmentName(sessionNamed("living")),
                      foreign = segmentName(sessionNamed("alien"));
    const Publisher held(sessionNamed("living"), smallScenery(), smallLabels());
    const RawSegment alien(foreign, 4096), young(living + "." + std::to_string(::getpid()), 4096);
    const pid_t child = leaveSegmentOfDead(sessionNamed("dead"));
    const RawSegment unfinished(dead + "." + std::to_string(child), 4096);
    {
        const Publisher next(sessionNamed("next"), smallScenery(), smallLabels());
    }
    EXPECT_FALSE(inMemory(dead));
    EXPECT_FALSE(inMemory(dead + "." + std::to_string(child)));
    EXPECT_TRUE(inMemory(living));
    EXPECT_TRUE(inMemory(living + "." + std::to_string(::getpid()))) << "of a process that lives";
    EXPECT_TRUE(inMemory(foreign)) << "not made by us";
    removeSegment(sessionNamed("alien"));
    ::shm_unlink((living + "." + std::to_string(::getpid())).c_str());
}

TEST(Session, OfARecycledPidIsTakenOver)
{
    const std::string session = sessionNamed("recycled");
    leaveSegmentOfDead(session);
    {
        RawSegment left(segmentName(session));
        left.at<Header>(0).ownerPid = static_cast<std::uint64_t>(::getpid());
        left.at<Header>(0).ownerStart = processStart(static_cast<std::uint64_t>(::getpid())) + 1;
    }
    EXPECT_FALSE(listed(session));
    const Publisher next(session, smallScenery(), smallLabels());
    EXPECT_TRUE(listed(session));
}

TEST(Session, APublisherRemovesOnlyItsOwnSegment)
{
    const std::string session = sessionNamed("own");
    std::optional<Publisher> old(std::in_place, session, smallScenery(), smallLabels());
    removeSegment(session);
    const Publisher next(session, smallScenery(), smallLabels());
    old.reset();
    EXPECT_TRUE(listed(session));
}

// Two containers may share /dev/shm and not see each other's processes: whose process cannot be seen lives all the same.
TEST(Session, OfAProcessThatCannotBeSeenStays)
{
    const std::string session = sessionNamed("unseen");
    const Publisher publisher(session, smallScenery(), smallLabels());
    RawSegment(segmentName(session)).at<Header>(0).ownerPid = 999999999;  // no process has this number
    const Publisher other(sessionNamed("beside"), smallScenery(), smallLabels());
    EXPECT_TRUE(inMemory(segmentName(session)));
    EXPECT_NE(tests::errorOf([&] { Publisher(session, smallScenery(), smallLabels()); }).find("in another container"),
              std::string::npos);
    EXPECT_TRUE(inMemory(segmentName(session)));
}

TEST(Session, GoesToExactlyOneOfSeveralNewcomers)
{
    constexpr int newcomers = 4;
    for (int round = 0; round < 10; ++round) {
        const std::string session = sessionNamed("race" + std::to_string(round));
        leaveSegmentOfDead(session);
        int start[2] = {}, hold[2] = {}, told[2] = {};
        ASSERT_EQ(::pipe(start) + ::pipe(hold) + ::pipe(told), 0);
        std::vector<pid_t> children;
        for (int i = 0; i < newcomers; ++i) {
            children.push_back(::fork());
            if (children.back() != 0)
                continue;
            char byte = 0;
            ::close(start[1]);
            ::close(hold[1]);
            [[maybe_unused]] auto n = ::read(start[0], &byte, 1);
            try {
                const Publisher publisher(session, smallScenery(), smallLabels());
                n = ::write(told[1], "y", 1);
                n = ::read(hold[0], &byte, 1);
            } catch (const std::runtime_error&) {
                n = ::write(told[1], "n", 1);
            }
            ::_exit(0);
        }
        ::close(start[1]);
        int winners = 0;
        for (int i = 0; i < newcomers; ++i) {
            char answer = 0;
            ASSERT_EQ(::read(told[0], &answer, 1), 1);
            winners += answer == 'y';
        }
        ::close(hold[1]);
        for (const pid_t child : children)
            ::waitpid(child, nullptr, 0);
        for (const int end : {start[0], hold[0], told[0], told[1]})
            ::close(end);
        EXPECT_EQ(winners, 1);
        removeSegment(session);
    }
}

TEST(Session, OutlivesAForkedChildOfItsPublisher)
{
    const std::string session = sessionNamed("forked");
    auto publisher = std::make_unique<Publisher>(session, smallScenery(), smallLabels());
    const pid_t child = ::fork();
    if (child == 0) {
        publisher.reset();
        ::_exit(0);
    }
    ::waitpid(child, nullptr, 0);
    EXPECT_TRUE(listed(session));
}

TEST(Session, OfAnotherVersionOrLayoutIsRefusedInWords)
{
    const std::string session = sessionNamed("version");
    const Publisher publisher(session, smallScenery(), smallLabels());
    RawSegment raw(segmentName(session));
    auto& header = raw.at<Header>(0);

    header.version = version + 1;
    EXPECT_NE(tests::errorOf([&] { Subscriber::attach(session); }).find("version " + std::to_string(version + 1)),
              std::string::npos);
    header.version = version;
    header.layoutHash ^= 1U;
    EXPECT_NE(tests::errorOf([&] { Subscriber::attach(session); }).find("different layouts"), std::string::npos);
    EXPECT_FALSE(listed(session));
    header.layoutHash ^= 1U;
    header.stateOffset = header.bytes - 8;
    EXPECT_NE(tests::errorOf([&] { Subscriber::attach(session); }).find("damaged"), std::string::npos);
}

TEST(Session, HalfBuiltOrForeignSegmentsAreRefused)
{
    const std::string session = sessionNamed("foreign");
    for (const std::size_t bytes : {std::size_t{10}, sizeof(Header), std::size_t{1} << 20U}) {
        const RawSegment raw(segmentName(session), bytes);
        EXPECT_NE(tests::errorOf([&] { Subscriber::attach(session); }).find("not made by palpate"), std::string::npos);
        removeSegment(session);
    }
}

// Larger than any address space: the mapping fails as it does without memory, and nobody else's segment is to blame.
TEST(Session, ASegmentThatCannotBeMappedIsNotCalledForeign)
{
    const std::string session = sessionNamed("huge");
    const base::Descriptor file(::shm_open(segmentName(session).c_str(), O_RDWR | O_CREAT | O_EXCL, 0600));
    ASSERT_EQ(::ftruncate(*file, off_t{1} << 48), 0);
    const std::string error = tests::errorOf([&] { Subscriber::attach(session); });
    removeSegment(session);
    EXPECT_NE(error.find("cannot be mapped: Cannot allocate memory"), std::string::npos) << error;
}

TEST(Session, EndsAsFinishedByStatusAndByTheEndOfItsPublisher)
{
    const std::string session = sessionNamed("ends");
    auto publisher = std::make_unique<Publisher>(session, smallScenery(), smallLabels());
    const auto subscriber = Subscriber::attach(session);
    ASSERT_TRUE(subscriber);
    State state = stateOf(1);
    publisher->setState(state);
    EXPECT_TRUE(subscriber->alive());
    state.status = Status::faulted;
    publisher->setState(state);
    EXPECT_TRUE(subscriber->alive()) << "a fault is shown, not the end";
    state.status = Status::finished;
    publisher->setState(state);
    EXPECT_EQ(subscriber->ending(), Ending::finished);
    state.status = Status::running;
    publisher->setState(state);
    EXPECT_TRUE(subscriber->alive());
    publisher.reset();
    EXPECT_EQ(subscriber->ending(), Ending::finished);
    EXPECT_EQ(subscriber->state()->tick, 1U) << "the last state stays readable";
}

TEST(Session, ViewersMapItReadOnly)
{
    const std::string session = sessionNamed("readonly");
    const pid_t child = forkAndHold([&] { new Publisher(session, smallScenery(), smallLabels()); });
    const auto subscriber = Subscriber::attach(session);
    ASSERT_TRUE(subscriber);
    std::ifstream maps("/proc/self/maps");
    int mappings = 0;
    for (std::string line; std::getline(maps, line);)
        if (line.find(segmentName(session)) != std::string::npos) {
            ++mappings;
            EXPECT_NE(line.find(" r--s "), std::string::npos) << line;
        }
    EXPECT_EQ(mappings, 1);
    killAndReap(child);
    removeSegment(session);
}

Scenery sceneryWithImage()
{
    Scenery scenery = smallScenery();
    scenery.windows = 1;
    scenery.window[0] = {{"soft tissue"}, -160, 240};
    return scenery;
}

std::vector<std::uint16_t> smallImage()
{
    std::vector<std::uint16_t> image;
    for (std::uint16_t i = 0; i < 60; ++i)
        image.push_back(static_cast<std::uint16_t>(1000 * i));
    return image;
}

std::uint64_t bytesOf(const std::string& session)
{
    return RawSegment(segmentName(session)).at<Header>(0).bytes;
}

// It takes its two bytes for each voxel, in whole pages, and a session without one takes none.
TEST(Session, BringsTheImageToViewersAndPaysOnlyWhereThereIsOne)
{
    const std::string plain = sessionNamed("plain"), session = sessionNamed("image");
    const Publisher without(plain, smallScenery(), smallLabels());
    const Publisher with(session, sceneryWithImage(), smallLabels(), smallImage());
    const auto viewer = Subscriber::attach(session), other = Subscriber::attach(plain);
    ASSERT_TRUE(viewer && other);
    const auto seen = viewer->image();
    EXPECT_EQ(std::vector<std::uint16_t>(seen.begin(), seen.end()), smallImage());
    const auto labels = viewer->labels();
    EXPECT_EQ(std::vector<std::uint8_t>(labels.begin(), labels.end()), smallLabels());
    EXPECT_EQ(viewer->scenery().window[0].high, 240);
    EXPECT_TRUE(other->image().empty());
    EXPECT_EQ(other->scenery().windows, 0U);
    EXPECT_EQ(bytesOf(session), bytesOf(plain) + 4096);
}

TEST(Session, AnImageThatDoesNotFillTheGridOrHasNoWindowIsRefused)
{
    const std::string session = sessionNamed("badimage");
    auto cut = smallImage();
    cut.pop_back();
    Scenery many = sceneryWithImage();
    many.windows = maxWindows + 1;
    const auto refused = [&](const Scenery& scenery, const std::vector<std::uint16_t>& image) {
        return tests::errorOf([&] { Publisher(session, scenery, smallLabels(), image); }).find("an image of") !=
               std::string::npos;
    };
    EXPECT_TRUE(refused(sceneryWithImage(), cut));
    EXPECT_TRUE(refused(sceneryWithImage(), {}));
    EXPECT_TRUE(refused(smallScenery(), smallImage()));
    EXPECT_TRUE(refused(many, smallImage()));
    EXPECT_FALSE(listed(session));
}

// A viewer reads as many codes as the grid has voxels: whatever in the segment says otherwise is damage.
TEST(Session, WhoseImageIsNotWhatTheSceneryClaimsIsRefused)
{
    const std::string session = sessionNamed("damaged");
    const Publisher publisher(session, sceneryWithImage(), smallLabels(), smallImage());
    RawSegment raw(segmentName(session));
    auto& header = raw.at<Header>(0);
    auto& scenery = raw.at<Scenery>(header.sceneryOffset);
    const auto refused = [&](auto& field, auto value) {
        const auto before = std::exchange(field, value);
        const bool damaged = tests::errorOf([&] { Subscriber::attach(session); }).find("damaged") != std::string::npos;
        field = before;
        return damaged;
    };
    EXPECT_TRUE(refused(header.imageBytes, 0U));
    EXPECT_TRUE(refused(header.imageBytes, 118U));
    EXPECT_TRUE(refused(header.imageOffset, header.bytes - 64));
    EXPECT_TRUE(refused(header.imageOffset, header.imageOffset + 1));
    EXPECT_TRUE(refused(scenery.windows, 0U));
    EXPECT_TRUE(refused(scenery.windows, static_cast<std::uint32_t>(maxWindows + 1)));
    EXPECT_TRUE(refused(scenery.labels.size[2], 30));
    EXPECT_TRUE(refused(scenery.labels.size[2], -3));
    EXPECT_TRUE(Subscriber::attach(session).has_value());
}

TEST(Session, BringsFineLabelsToViewers)
{
    const std::string session = sessionNamed("fine");
    Scenery scenery = smallScenery();
    scenery.fine = {{4, 3, 2}, 0, {0, 0, 0}, 1e-4};
    std::vector<std::uint8_t> fine(24);
    std::iota(fine.begin(), fine.end(), std::uint8_t{1});
    {
        const Publisher publisher(session, scenery, smallLabels(), {}, fine);
        const auto viewer = Subscriber::attach(session);
        ASSERT_TRUE(viewer);
        EXPECT_EQ(std::vector<std::uint8_t>(viewer->fine().begin(), viewer->fine().end()), fine);
        RawSegment raw(segmentName(session));
        raw.at<Header>(0).fineBytes = 23;
        EXPECT_NE(tests::errorOf([&] { Subscriber::attach(session); }).find("damaged"), std::string::npos);
    }
    fine.pop_back();
    EXPECT_NE(tests::errorOf([&] { Publisher(session, scenery, smallLabels(), {}, fine); }).find("23 fine labels"),
              std::string::npos);
    EXPECT_FALSE(listed(session));
}

TEST(Session, LabelsThatDoNotFillTheGridAreRefused)
{
    const std::string session = sessionNamed("labels");
    auto labels = smallLabels();
    labels.pop_back();
    EXPECT_THROW(Publisher(session, smallScenery(), labels), std::runtime_error);
    EXPECT_FALSE(listed(session));
}

}  // namespace
}  // namespace palpate::channel
