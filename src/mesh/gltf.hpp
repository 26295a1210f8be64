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

#include "cairn/camera.hpp"
#include "cairn/export.hpp"
#include "cairn/mesh.hpp"
#include "cairn/trajectory.hpp"
#include "cairn/upright.hpp"

namespace cairn {

/// The attribute of Mesh::sigmas.
inline constexpr const char* kSigma = "_SIGMA";

/// How a GltfWriter writes.
struct GltfOptions {
  Compression compression = Compression::none;
  bool png = false;  // textures as PNG instead of JPEG
  int jpeg_quality = 90;
  bool lit = false;                // instead of KHR_materials_unlit
  std::string source;              // told in asset.extras
  std::optional<Upright> upright;  // told there, too; none: +y is up
  Axes axes = Axes::automatic;     // told there as well; glTF itself asks for y_up
  bool is_whole = false;           // it gets one mesh, which no other part goes on from
  std::filesystem::path file;      // where it will be: what was added waits on that disk; empty: in memory
};

/// One glTF file, part by part. What was added is kept as it will be written, compressed.
class GltfWriter {
 public:
  explicit GltfWriter(GltfOptions options = {});
  ~GltfWriter();
  GltfWriter(GltfWriter&&) noexcept;
  /// Adds a node; a mesh without triangles adds nothing. Returns what is left on the grid of quantised positions.
  struct Added {
    std::size_t triangles = 0, vertices = 0;
  };
  Added add(const std::string& name, const Mesh& mesh);
  /// Adds the camera's path as a line, and a camera for each pose.
  void add_cameras(const Camera& camera, const Trajectory& path, const std::vector<Eigen::Isometry3d>& cameras);
  /// .glb, or .gltf with a .bin and the textures beside it. Whole or not at all; what lies beside it comes first.
  /// Returns what was written, the file itself first.
  std::vector<std::filesystem::path> write(const std::filesystem::path& file) const;
  /// Puts a .glb into a stream.
  void put(std::ostream& out) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The bytes of a .glb with JSON and one buffer.
[[nodiscard]] std::vector<std::uint8_t> join_glb(std::string json, std::vector<std::uint8_t> buffer);

/// A mesh with its positions on the grid on which glTF's quantised ones lie, with coarser sigmas, and without triangles
/// that have no area there. `is_whole`: no other part goes on from it, see make_manifold.
struct Snapped {
  Mesh mesh;
  Eigen::Vector3f low = Eigen::Vector3f::Zero();  // in glTF's frame
  float step = 1;
};
[[nodiscard]] Snapped snap(const Mesh& mesh, bool is_whole = false);

/// Undoes EXT_meshopt_compression and KHR_draco_mesh_compression, which tinygltf does not know. `file` is what the
/// bytes are of; those without come back as they are.
[[nodiscard]] std::vector<std::uint8_t> decompressed_gltf(const std::filesystem::path& file);

[[nodiscard]] std::vector<Mesh> read_gltf_parts(const std::filesystem::path& file);

}  // namespace cairn
