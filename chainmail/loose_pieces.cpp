#include <chainmail/loose_pieces.h>

#include <algorithm>
#include <limits>

namespace palpate::chainmail {

namespace {

constexpr std::size_t crumb = 64;     // cells
constexpr double onItsBack = 0.05;    // fraction of a piece's depth that is held
const Vec3 backwards(0.0, 1.0, 0.0);  // patient frame

class Pieces {
public:
    Pieces(const volume::NodeGrid& cells, const std::vector<volume::CellMaterial>& materials)
        : cells_(cells), materials_(materials), seen_(materials.size(), 0)
    {
    }

    // The cells of the piece around cell `first`; none where it was looked at before.
    std::vector<std::size_t> from(std::size_t first)
    {
        std::vector<std::size_t> piece;
        take(first, piece);
        for (std::size_t next = 0; next < piece.size(); ++next) {
            const Index3 c = cells_.node(piece[next]);
            for (int side = 0; side < 6; ++side) {
                Index3 beside = c;
                beside[side / 2] += side % 2 == 0 ? 1 : -1;
                if (cells_.contains(beside)) {
                    take(cells_.offset(beside), piece);
                }
            }
        }
        return piece;
    }

private:
    void take(std::size_t at, std::vector<std::size_t>& piece)
    {
        if (seen_[at] == 0 && materials_[at].youngsModulus > 0.0F) {
            seen_[at] = 1;
            piece.push_back(at);
        }
    }

    const volume::NodeGrid& cells_;
    const std::vector<volume::CellMaterial>& materials_;
    std::vector<std::uint8_t> seen_;
};

}  // namespace

int holdLoosePieces(const volume::NodeGrid& cells, std::vector<volume::CellMaterial>& materials,
                    const std::optional<volume::Support>& support)
{
    const auto placeOf = [&](std::size_t at) { return cells.position(cells.node(at)); };
    const auto isHeld = [&](std::size_t at) {
        return materials[at].fixed > 0.0F || (support && support->height(placeOf(at)) < 0.0);
    };
    Pieces pieces(cells, materials);
    int held = 0;
    for (std::size_t first = 0; first < materials.size(); ++first) {
        const auto piece = pieces.from(first);
        if (piece.size() < crumb || std::ranges::any_of(piece, isHeld)) {
            continue;
        }
        double front = std::numeric_limits<double>::max(), back = -front;
        for (const std::size_t at : piece) {
            front = std::min(front, glm::dot(placeOf(at), backwards));
            back = std::max(back, glm::dot(placeOf(at), backwards));
        }
        const double layer = std::max(0.5 * cells.spacing, onItsBack * (back - front));
        for (const std::size_t at : piece) {
            materials[at].fixed = glm::dot(placeOf(at), backwards) > back - layer ? 1.0F : 0.0F;
        }
        ++held;
    }
    return held;
}

}  // namespace palpate::chainmail
