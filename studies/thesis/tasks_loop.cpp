#include <studies/thesis/tasks_loop.h>

#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::studies {

std::size_t ObjectScene::collide(Vec3 tip) const noexcept
{
    std::size_t deepest = none;
    double depth = 0.0;
    for (std::size_t i = 0; i < objects_.size(); ++i) {
        const Vec3 off = tip - objects_[i].centre;
        const double radius = objects_[i].radius;
        if (glm::dot(off, off) < radius * radius && radius - glm::length(off) > depth) {
            deepest = i;
            depth = radius - glm::length(off);
        }
    }
    return deepest;
}

Vec3 ObjectScene::feedback(std::size_t object, Vec3 tip) const noexcept
{
    if (object == none) {
        return Vec3(0.0);
    }
    const Vec3 off = tip - objects_[object].centre;
    const double distance = glm::length(off);
    const Vec3 out = distance > 0.0 ? off / distance : Vec3(0, -1, 0);
    return stiffness_ * (objects_[object].radius - distance) * out;
}

std::array<haptics::Proximity, haptics::maxStructures> ObjectScene::monitor(Vec3 tip) const noexcept
{
    std::array<haptics::Proximity, haptics::maxStructures> near{};
    for (std::size_t i = 0; i < std::min(monitored, objects_.size()); ++i) {
        const Vec3 off = tip - objects_[i].centre;
        const double distance = glm::length(off);
        near[i].distance = distance - objects_[i].radius;
        near[i].away = distance > 0.0 ? off / distance : Vec3(0, -1, 0);
        near[i].vital = i > 0;
        near[i].touching = near[i].distance < 0.0;
    }
    return near;
}

}  // namespace palpate::studies
