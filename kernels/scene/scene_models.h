/// \file scene_models.h
/// The built-in implicit scenes.
#pragma once
#include <memory>

#include "kernels/scene/scene.h"

namespace tessera::synth {

[[nodiscard]] std::unique_ptr<Scene>
make_parts();  ///< machine parts with blends, bores and teeth on a table, 5 x 4 units
[[nodiscard]] std::unique_ptr<Scene>
make_statue();  ///< seated bear with a fur-like skin on a turned pedestal, 2.6 units high
[[nodiscard]] std::unique_ptr<Scene> make_indoor();  ///< furnished room, 8 x 6 x 3 units, seen from inside
[[nodiscard]] std::unique_ptr<Scene>
make_city();  ///< streets, buildings and trees on rolling ground, 600 x 600 units

}  // namespace tessera::synth
