#pragma once

#include "temp_folder.h"

namespace tabletop_perception::tools {

/// Writes a folder `models` of one object, "wedge": a tetrahedron with sides of different lengths,
/// of a diameter of 22 cm, without symmetry.
inline void writeWedgeModel(const TempFolder& folder) {
  folder.write("models/wedge/mesh.ply",
               "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
               "property float z\nelement face 4\nproperty list uchar int vertex_indices\n"
               "end_header\n0 0 0\n0.2 0 0\n0 0.1 0\n0 0 0.05\n"
               "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n");
  folder.write("models/models_info.json", R"({"wedge": {"symmetry": "none"}})");
}

}  // namespace tabletop_perception::tools
