#include <base/build.h>

namespace palpate::base {

std::string_view build() noexcept
{
    return PALPATE_BUILD;
}

}  // namespace palpate::base
