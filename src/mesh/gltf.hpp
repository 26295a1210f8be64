// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "cairn/mapping/camera.hpp"
#include "cairn/mapping/export_options.hpp"
#include "cairn/mapping/gravity_alignment.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

/// Attribute name of Mesh::sigmas.
inline constexpr const char* kSigma = "_SIGMA";

/// Options of a GltfWriter.
struct GltfOptions {
  Compression compression = Compression::none;
  bool png = false;  // textures as PNG instead of JPEG
  int jpeg_quality = 90;
  bool lit = false;                         // lit materials instead of KHR_materials_unlit
  std::string source;                       // written to asset.extras
  std::optional<GravityAlignment> upright;  // written to asset.extras, too; none: +y is up
  Axes axes = Axes::automatic;              // written to asset.extras, too; glTF itself requires y_up
  bool is_single_mesh = false;              // a single mesh, without neighbors in other files
  std::filesystem::path file;               // output path: data is buffered on its disk; empty: in memory
};

/// Incremental writer of a glTF file. Added meshes are stored in their final, compressed form.
class GltfWriter {
 public:
  explicit GltfWriter(GltfOptions options = {});
  ~GltfWriter();
  GltfWriter(GltfWriter&&) noexcept;
  /// Adds a node; ignores a mesh without triangles. Returns the counts after quantization of the positions.
  struct Added {
    std::size_t triangles = 0, vertices = 0;
  };
  Added add(const std::string& name, const Mesh& mesh);
  /// Adds the camera path as a line, and a camera per pose.
  void add_cameras(const Camera& camera, const Trajectory& path, const std::vector<Eigen::Isometry3d>& cameras);
  /// Writes a .glb, or a .gltf with a .bin and the textures in the same folder. Atomic; external files are written
  /// first. Returns the written files, the .glb or .gltf first.
  std::vector<std::filesystem::path> write(const std::filesystem::path& file) const;
  /// Writes a .glb to a stream.
  void put(std::ostream& out) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Bytes of a .glb from JSON and a buffer.
[[nodiscard]] std::vector<std::uint8_t> join_glb(std::string json, std::vector<std::uint8_t> buffer);

/// A mesh with positions on the quantization grid of glTF, rounded sigmas, and without triangles that lose their area.
/// `is_single_mesh`: the mesh has no neighbors in other parts; see make_manifold.
struct Snapped {
  Mesh mesh;
  Eigen::Vector3f low = Eigen::Vector3f::Zero();  // in the glTF frame
  float step = 1;
};
[[nodiscard]] Snapped snap(const Mesh& mesh, bool is_single_mesh = false);

/// Decodes EXT_meshopt_compression and KHR_draco_mesh_compression, which tinygltf does not support, and returns the
/// result as a .glb. Returns an empty vector for files without them.
[[nodiscard]] std::vector<std::uint8_t> decompressed_gltf(const std::filesystem::path& file);

[[nodiscard]] std::vector<Mesh> read_gltf_parts(const std::filesystem::path& file);

}  // namespace cairn
