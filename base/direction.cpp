#include <base/direction.h>

#include <base/words.h>

#include <cmath>

namespace palpate::base {

const char* sideInWords(int axis, bool positive) noexcept
{
    constexpr const char* sides[3][2] = {{marked("the patient's right"), marked("the patient's left")},
                                         {marked("the front"), marked("the back")},
                                         {marked("the feet"), marked("the head")}};
    return sides[axis][positive ? 1 : 0];
}

const char* directionInWords(double left, double back, double head) noexcept
{
    const double x = std::abs(left), y = std::abs(back), z = std::abs(head);
    if (z >= x && z >= y) {
        return sideInWords(2, head > 0);
    }
    return x >= y ? sideInWords(0, left > 0) : sideInWords(1, back > 0);
}

}  // namespace palpate::base
