#include <volume/tissue_table.h>

#include <algorithm>

namespace palpate::volume {

namespace {

constexpr std::array<std::string_view, 6> roleNames = {"plain", "skin", "tumour", "vital", "bone", "air"};

}  // namespace

std::string_view name(Role role) noexcept
{
    return roleNames[static_cast<std::size_t>(role)];
}

std::optional<Role> roleNamed(std::string_view name) noexcept
{
    const auto at = std::find(roleNames.begin(), roleNames.end(), name);
    if (at == roleNames.end()) {
        return std::nullopt;
    }
    return static_cast<Role>(at - roleNames.begin());
}

std::optional<std::uint8_t> TissueTable::find(std::string_view wanted) const noexcept
{
    const auto at = std::find_if(rows.begin(), rows.end(), [&](const TissueRow& row) { return row.name == wanted; });
    if (at == rows.end()) {
        return std::nullopt;
    }
    return static_cast<std::uint8_t>(at - rows.begin());
}

}  // namespace palpate::volume
