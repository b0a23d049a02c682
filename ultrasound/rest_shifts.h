#pragma once

#include <ultrasound/view.h>

#include <vector>

namespace palpate::ultrasound {

/// Where at rest a surface of the picture's space lies: the inverse of the deformation at the points of a net, linear
/// between them. Where neighbours of the net lie further apart than `apart`, as at both sides of a fold, points between
/// them are solved by themselves.
class RestShifts {
public:
    static constexpr float apart = 0.5F;  // [lattice spacings]

    /// Solves the net.
    /// @param columns  points along each row, `stride` of the caller's columns apart (the last one may lie nearer)
    /// @param point    of a caller's column and a row: the place in the probe's frame [m]
    template <typename Point>
    void solve(const View& view, int columns, int stride, int rows, Point&& point)
    {
        columns_ = columns;
        stride_ = stride;
        across_ = (columns + stride - 2) / stride + 1;
        shift_.resize(static_cast<std::size_t>(across_) * static_cast<std::size_t>(rows));
        if (view.still())
            return;
        for (int r = 0; r < rows; ++r) {
            glm::vec3 shift = r > 0 ? shift_[at(0, r - 1)] : glm::vec3(0);
            for (int c = 0; c < across_; ++c) {
                view.follow(point(columnAt(c), r), shift);
                shift_[at(c, r)] = shift;
            }
        }
    }

    /// The voxel at rest of what is at `point`, which is that of `column` and `row`.
    glm::vec3 voxel(const View& view, glm::vec3 point, int column, int row) const noexcept
    {
        if (view.still())
            return view.voxel(point, glm::vec3(0));
        const int c = column / stride_, first = columnAt(c);
        if (column == first)
            return view.voxel(point, shift_[at(c, row)]);
        const glm::vec3 a = shift_[at(c, row)], b = shift_[at(c + 1, row)], change = b - a;
        const float part = static_cast<float>(column - first) / static_cast<float>(columnAt(c + 1) - first);
        glm::vec3 shift = a + part * change;
        if (glm::dot(change, change) > apart * apart)
            view.follow(point, shift);
        return view.voxel(point, shift);
    }

private:
    int columnAt(int c) const noexcept { return c * stride_ < columns_ ? c * stride_ : columns_ - 1; }
    std::size_t at(int c, int row) const noexcept
    {
        return static_cast<std::size_t>(row) * static_cast<std::size_t>(across_) + static_cast<std::size_t>(c);
    }

    int columns_ = 0, stride_ = 1, across_ = 0;
    std::vector<glm::vec3> shift_;  // (rows x columns of the net) [lattice spacings]
};

}  // namespace palpate::ultrasound
