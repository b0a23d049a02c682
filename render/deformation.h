#pragma once

#include <channel/deformation.h>

/// The deformed body is the channel's, since the ultrasound picture sees it too; its names are used all over the viewer.
namespace palpate::render {

using channel::Deformation;
using channel::enclosing;
using channel::vec;
using channel::VoxelBox;

}  // namespace palpate::render
