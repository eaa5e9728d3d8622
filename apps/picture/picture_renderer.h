#pragma once

#include <filesystem>

#include "apps/picture/picture_scene.h"

namespace cadmorph {

/// Draws the pictures of a scene with VTK into its folder. Needs an X server to render on (see
/// PrivateDisplay); without one VTK ends the process. Throws IoError when a surface can't be read
/// or a picture can't be written.
void draw(const Scene& scene, const std::filesystem::path& folder);

}  // namespace cadmorph
