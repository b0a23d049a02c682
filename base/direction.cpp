#include <base/direction.h>

#include <cmath>

namespace palpate::base {

const char* directionInWords(double left, double back, double head) noexcept
{
    const double x = std::abs(left), y = std::abs(back), z = std::abs(head);
    if (z >= x && z >= y) {
        return head > 0 ? "the head" : "the feet";
    }
    if (x >= y) {
        return left > 0 ? "the patient's left" : "the patient's right";
    }
    return back > 0 ? "the back" : "the front";
}

}  // namespace palpate::base
