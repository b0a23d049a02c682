#pragma once

#include <chainmail/deformation.h>
#include <chainmail/elastic.h>

#include <array>
#include <concepts>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace palpate::chainmail {

/// How a tool holds on to tissue in this tick.
struct Grip {
    enum class Kind : std::uint8_t {
        none,
        press,  // from outside, with its surface
        point,  // a tip has hold of the material point `proxy`, at the surface or inside
    } kind = Kind::none;
    occupancy::RoundCone shape;  // of a tool that presses, where it is now [m]
    Vec3 proxy{0.0};             // what it holds, at rest: of a sphere its centre without penetration [m]
    Vec3 deepest{0.0};           // of a tool that presses: from there to the place on its axis that lies deepest [m]
    Vec3 position{0.0};          // where the tool has it now [m]
    double radius = 0;           // of a tip that holds a point [m]
    bool inside = false;         // that point is inside the tissue
    Vec3 entry{0.0};             // where the shaft went in, at rest [m]
    Vec3 axis{0, 1, 0};          // along the tool, towards its tip
    double drag = 0;             // how far a shaft carries the tissue around it along `axis` [m]
    Vec3 pushedAtTip{0.0}, pushedAtEntry{0.0};  // by others, where the shaft is [m]
    double friction = 0;                        // of a tool that presses (Coulomb) [-]
    std::span<const ElasticTool> others;  // tools that press besides, ElasticLevel::maxOthers at most; only level elastic
                                          // knows them. They must live until the next call
};

struct Reaction {
    std::uint32_t moved = 0;    // nodes that are not at rest
    double residual = 0;        // of the level's own: largest violated link [m]
    std::optional<Vec3> force;  // of the tissue on the tool; none where the level does not know it [N]
    double depth = 0;           // of the deepest point of tissue inside the tool, where the force is known [m]
    double behind = 0;          // by how much the tool is held back, see Elastic::behind() [m]
    Vec3 othersForce{0.0};      // of the tissue on Grip::others together [N]
};

/// A level of the model ladder: leaves the displaced lattice behind for collision, distances and the viewer. Bounded work,
/// no allocation.
template <typename L>
concept Level = requires(L& level, const Grip& grip)
{
    {
        level.deform(grip)
    }
    noexcept->std::same_as<Reaction>;
};

/// Level 0: rigid tissue. What a level above has left goes back to rest, some nodes per call.
class SpringLevel {
public:
    explicit SpringLevel(DisplacedLattice& shape) : shape_(shape) {}
    SpringLevel& operator=(SpringLevel&&) = delete;
    Reaction deform(const Grip& grip) noexcept;

private:
    DisplacedLattice& shape_;
};

/// Level 1: ChainMail from rest.
class ChainMailLevel {
public:
    /// Both must outlive it.
    ChainMailLevel(Deformation& deformation, double toolRadius);
    ChainMailLevel& operator=(ChainMailLevel&&) = delete;
    Reaction deform(const Grip& grip) noexcept;

private:
    Deformation& deformation_;
    std::vector<Seed> seeds_;
};

/// Of a tie that holds the point `rest`: 8 E h, with E of the finest cell that the point lies in; 0 where that is empty
/// [N/m].
double tieStiffnessAt(const ElasticBody& body, Vec3 rest) noexcept;

/// Level 2: elastic equilibrium on nested windows; forces of a pressing tool come from its energy, from first touch on.
///
/// The lattice gets the windows' displacement at the middles of their cells: around the tool in every call, further out by
/// turns, a fixed number of nodes per call. While a tip holds the tissue, or only Grip::others press, the hand has no force
/// from here, and solving and writing take turns too: the shape is that of up to ElasticOptions::heldPeriod calls ago.
/// Tissue that would turn inside out keeps the shape it had: the lattice goes towards the windows' shape only as far as
/// every cell keeps its orientation.
class ElasticLevel {
public:
    /// All must outlive it. The body's cells are the lattice's nodes.
    ElasticLevel(DisplacedLattice& shape, const ElasticBody& body, const volume::DistanceField& surface,
                 const ElasticOptions& options, Vec3 start);
    ElasticLevel& operator=(ElasticLevel&&) = delete;
    Reaction deform(const Grip& grip) noexcept;
    const Elastic& elastic() const noexcept { return elastic_; }
    /// Goes on from another level with the same body, whose windows are others: tissue has relaxed as far as there.
    void takeOver(ElasticLevel& from) noexcept { elastic_.beginWith(from.elastic_.historyShares()); }
    static constexpr std::size_t maxOthers = 7;

private:
    static constexpr std::size_t maxShaftTies = 8;

    ElasticLoad load(const Grip& grip) noexcept;
    ElasticLoad tie(const Grip& grip) noexcept;
    void writeFinest(Vec3 around, int layers) noexcept;
    void takeFragments(Index3 first, std::size_t count, Vec3f* out) const noexcept;
    void writeBox(Index3 low, Index3 high) noexcept;
    void write(Node n, Index3 at) noexcept;
    void writeWider() noexcept;
    void writeByTurns(std::size_t level) noexcept;
    void revisitMoved() noexcept;
    bool keepsOrientation(Index3 low, Index3 high) noexcept;
    bool findLongLinks(Index3 low, Index3 high) noexcept;
    void markStrained(Node n) noexcept;
    void markWithNeighbours(Node n) noexcept;
    bool upright(Node n) const noexcept;

    DisplacedLattice& shape_;
    const volume::DistanceField& surface_;
    Elastic elastic_;
    int period_;  // calls from one solution to the next while a tip holds the tissue
    int turn_ = 0;
    int since_ = 0;                                 // calls since the last solution
    bool isFirst_ = true;                           // no call yet
    bool isShapeOnly_ = false;                      // the last call's force on the hand was not from here
    std::array<ElasticTool, maxOthers + 1> tools_;  // the others, then the hand's: so each keeps its place
    std::array<Tie, 1 + maxShaftTies> ties_;        // the tip's, then the shaft's
    std::vector<Vec3f> before_;                     // nodes of a box as they were, and as the windows have them
    std::vector<Vec3f> now_;
    std::vector<std::uint8_t> strained_;  // not 0 for nodes with a link shifted by over a third of its length
    std::vector<std::uint8_t>
        longRows_;               // not 0 for rows of a box in which a link begins that is shifted so, to tissue or not
    std::vector<Index3> turns_;  // by level: where its turn is
    std::size_t revisited_ = 0;
    ElasticResult last_;
};

static_assert(Level<SpringLevel> && Level<ChainMailLevel> && Level<ElasticLevel>);

}  // namespace palpate::chainmail
