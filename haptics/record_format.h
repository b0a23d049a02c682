#pragma once

// How a record lies in its SQLite file; shared by the writer (recorder.cpp) and the reader (record.cpp), no public header.

#include <haptics/record_seal.h>
#include <haptics/recorder.h>
#include <haptics/tick.h>

#include <sqlite3.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace palpate::haptics::format {

inline constexpr int applicationId = 0x50414C50;  // "PALP", in the file's header
inline constexpr int version = 5;                 // user_version; raise it when a table changes
inline constexpr int oldestVersion = 2;           // that is still read: its ticks have no tissue force
inline constexpr int sealedVersion = 4;           // the first whose records are sealed when they are closed
inline constexpr int probeVersion = 5;            // the first that has the ultrasound probe, where the scene holds one

inline constexpr std::uint8_t none = 0xFF;  // a structure that is not there; NULL in the file

inline constexpr std::array<const char*, maxStructures> distanceColumns{
    "distance_0_m",  "distance_1_m",  "distance_2_m",  "distance_3_m", "distance_4_m",  "distance_5_m",
    "distance_6_m",  "distance_7_m",  "distance_8_m",  "distance_9_m", "distance_10_m", "distance_11_m",
    "distance_12_m", "distance_13_m", "distance_14_m", "distance_15_m"};
inline constexpr std::array<const char*, maxStructures> aheadColumns{
    "ahead_0_m", "ahead_1_m", "ahead_2_m",  "ahead_3_m",  "ahead_4_m",  "ahead_5_m",  "ahead_6_m",  "ahead_7_m",
    "ahead_8_m", "ahead_9_m", "ahead_10_m", "ahead_11_m", "ahead_12_m", "ahead_13_m", "ahead_14_m", "ahead_15_m"};
inline constexpr std::array<const char*, taskCount> taskColumns{"h2_us", "h3_us", "h4_us", "deform_us",
                                                                "h6_us", "h7_us", "h5_us"};

/// The texts of a session in table `session`, in the order of the file.
inline constexpr std::array<std::pair<const char*, std::string SessionInfo::*>, 11> infoTexts{
    {{"scene", &SessionInfo::scene},
     {"scene_text", &SessionInfo::sceneText},
     {"scene_origin", &SessionInfo::sceneOrigin},
     {"volume_hash", &SessionInfo::volumeHash},
     {"model", &SessionInfo::model},
     {"device", &SessionInfo::device},
     {"name", &SessionInfo::name},
     {"operator", &SessionInfo::operatorName},
     {"host", &SessionInfo::host},
     {"started", &SessionInfo::started},
     {"build", &SessionInfo::build}}};

/// The index of a structure, of which 0xFF means none.
template <class Byte>
struct OptionalIndex {
    Byte& value;
};
template <class Byte>
OptionalIndex(Byte&) -> OptionalIndex<Byte>;  // clang below 17 wants it said

/// A time [s] that the file holds in microseconds.
template <class Seconds>
struct Microseconds {
    Seconds& value;
};
template <class Seconds>
Microseconds(Seconds&) -> Microseconds<Seconds>;

/// What decides which columns table `ticks` has.
struct TickColumns {
    std::size_t structures = 0;
    bool probe = false;  // the scene holds an ultrasound probe
    int of = version;    // version of the file
};
inline TickColumns columnsOf(const SessionInfo& info, int of = version)
{
    return {info.structures.size(), info.probe, of};
}

/// Calls `visit(column, field)` for every column of table `ticks`, in the order of the file. One list serves the table's
/// making, the writing (Tick = const TickRecord) and the reading (Tick = TickRecord).
template <class Tick, class Visit>
void eachColumn(Tick& t, const TickColumns& columns, Visit&& visit)
{
    const auto vector = [&](const char* x, const char* y, const char* z, auto& v) {
        visit(x, v.x);
        visit(y, v.y);
        visit(z, v.z);
    };
    visit("tick", t.tick);
    vector("tip_x_m", "tip_y_m", "tip_z_m", t.device.position);
    vector("axis_x", "axis_y", "axis_z", t.device.axis);
    visit("buttons", t.device.buttons);
    visit("fresh", t.device.fresh);
    vector("proxy_x_m", "proxy_y_m", "proxy_z_m", t.proxy);
    if (columns.of > oldestVersion) {
        vector("tissue_force_x_n", "tissue_force_y_n", "tissue_force_z_n", t.tissueForce);
    }
    vector("basic_x_n", "basic_y_n", "basic_z_n", t.basic);
    vector("additional_x_n", "additional_y_n", "additional_z_n", t.additional);
    vector("total_x_n", "total_y_n", "total_z_n", t.total);
    visit("energy_j", t.energy);
    visit("damped_j", t.damped);
    visit("phase", t.phase);
    visit("tissue", t.tissue);
    visit("inserted_m", t.inserted);
    visit("contacts", t.contacts);
    visit("penetration_m", t.penetration);
    visit("moved", t.moved);
    visit("residual_m", t.residual);
    visit("nearest_vital", OptionalIndex{t.nearestVital});
    visit("warning", t.warning);
    visit("warned", OptionalIndex{t.warned});
    vector("deflection_x_m", "deflection_y_m", "deflection_z_m", t.deflection);
    visit("ahead_m", t.ahead.tissueDistance);
    visit("ahead_tissue", t.ahead.tissue);
    visit("ahead_m_s", t.ahead.speed);
    visit("fired", t.fired);
    visit("faulted", t.faulted);
    for (std::size_t i = 0; i < columns.structures && i < maxStructures; ++i) {
        visit(distanceColumns[i], t.distance[i]);
        visit(aheadColumns[i], t.ahead.structure[i]);
    }
    for (std::size_t i = 0; i < taskCount; ++i) {
        visit(taskColumns[i], Microseconds{t.seconds[i]});
    }
    if (columns.probe) {
        visit("probe_press_m", t.device.probe.press);
        visit("probe_slide_m", t.device.probe.slide);
        visit("probe_sweep_m", t.device.probe.sweep);
        visit("probe_rock_rad", t.device.probe.rock);
        visit("probe_tilt_rad", t.device.probe.tilt);
        visit("probe_turn_rad", t.device.probe.turn);
        vector("probe_face_x_m", "probe_face_y_m", "probe_face_z_m", t.probeFace);
        vector("probe_axis_x", "probe_axis_y", "probe_axis_z", t.probeAxis);
        vector("probe_lateral_x", "probe_lateral_y", "probe_lateral_z", t.probeLateral);
        vector("probe_force_x_n", "probe_force_y_n", "probe_force_z_n", t.probeForce);
        visit("needle_in_beam_m", t.needleInBeam);
        visit("tip_in_beam", t.tipInBeam);
    }
}

/// The names of all columns, separated by commas.
std::string columnList(const TickColumns& columns);

/// The statements that make the tables of a session, by table.
std::vector<std::pair<std::string, std::string>> schema(const SessionInfo& info);

/// For Database: the file of this name, where SQLite would take "file:a.db" or ":memory:" for something else.
std::string placeOf(const std::filesystem::path& file);

/// For Database, with SQLITE_OPEN_URI.
/// @param isImmutable  read as it lies on a medium that cannot be written, without a look at locks; not beside a log
std::string uriOf(const std::filesystem::path& file, bool isImmutable);

/// An open SQLite file. Errors come as std::runtime_error with SQLite's words and without the file's name.
class Database {
public:
    Database(const std::string& file, int flags);
    ~Database();
    Database& operator=(Database&&) = delete;

    void execute(const std::string& sql);
    sqlite3* get() const noexcept { return handle_; }

private:
    sqlite3* handle_ = nullptr;
};

/// A prepared statement: bind by position from 1 up, read by column from 0 up.
class Statement {
public:
    Statement(const Database& database, const std::string& sql);
    /// With these values bound from the first position on.
    template <class... Values>
    Statement(const Database& database, const std::string& sql, const Values&... values) : Statement(database, sql)
    {
        bindAll(values...);
    }
    ~Statement();
    Statement& operator=(Statement&&) = delete;

    void bind(int position, double value);
    void bind(int position, std::int64_t value);
    void bind(int position, std::string_view value);
    void bindNull(int position);
    template <class... Values>
    void bindAll(const Values&... values)
    {
        int position = 0;
        (bind(++position, values), ...);
    }

    /// What is bound from now on goes into `digest` too, a row with each run(). It must outlive the statement or be
    /// replaced.
    void digestInto(RowDigest* digest) noexcept { digest_ = digest; }

    /// True when there is a row.
    bool step();
    /// Runs a statement that gives no rows, and makes it ready for the next.
    void run();

    double real(int column) const;
    std::int64_t integer(int column) const { return sqlite3_column_int64(handle_, column); }
    std::string_view text(int column) const;
    int type(int column) const { return sqlite3_column_type(handle_, column); }
    bool isNull(int column) const { return type(column) == SQLITE_NULL; }
    /// The row as it is, into a digest.
    void digestRow(RowDigest& digest) const;

private:
    void check(int status);
    sqlite3_stmt* handle_ = nullptr;
    sqlite3* database_ = nullptr;
    RowDigest* digest_ = nullptr;
};

}  // namespace palpate::haptics::format
