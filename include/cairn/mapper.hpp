// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cairn/esdf.hpp"
#include "cairn/frame.hpp"
#include "cairn/map.hpp"
#include "cairn/options.hpp"
#include "cairn/reports.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

struct MapState;

enum class Poses {
  tracked,  ///< found by aligning each frame with the map, in the first camera's frame; what is written of it stands
            ///< upright, see Mapper::upright
  given     ///< taken from Frame::world_from_camera
};

/// From a stream of frames to a map: start here.
///
///   auto source = cairn::open_source("rgbd_dataset_freiburg1_desk");
///   cairn::Mapper mapper(source->rig());
///   while (auto frame = source->next()) mapper.add(*frame);
///   mapper.map().export_mesh("desk.glb");
///
/// What is not asked of a mapper is asked of its Map; a Session lets it go on after its program has ended; a
/// LiveSurface shows it while it grows. One thread at a time.
class Mapper {
 public:
  /// All stays in memory; with a Session it does not. `device`: as list_devices numbers them; -1 chooses. Throws
  /// std::runtime_error for cameras or options out of range (see check), and for a device that cannot be used.
  explicit Mapper(const Rig& rig, const Options& options = {}, Poses poses = Poses::tracked, int device = -1);

  /// Aligns and fuses the next frame; of one that is held out only the pose is kept (Frame::held_out). Bad frames and
  /// lost tracking are told in the report. Throws std::runtime_error only when the device fails or its memory does not
  /// hold one view; what was fused before can still be read and written.
  FrameReport add(const Frame& frame);
  /// Another recording follows, which begins somewhere in the map or outside of it. Frames are tracked once their place
  /// is recognised; before that they are lost, and after a while they begin a component of their own.
  void begin_recording();

  /// Moves the keyframes as all loops so far say, as what is asked of map() does: call it before trajectory() when no
  /// frame follows.
  void settle();
  /// Aligns keyframes that see the same with each other and corrects the poses; the map follows by moving the submaps.
  /// `goes_on` is told the share that is done and says whether to go on. When it says no, or when the work fails, the
  /// poses stay as they are, and a warning tells why.
  Refined refine(const std::function<bool(double)>& goes_on = {});
  /// Moves the keyframes to where depth and brightness of all that they see agree best, all together, with the colour
  /// camera's clock, how long shutters take to read an image's rows, and what the depth camera errs by (bundle
  /// adjustment after Schöps, Sattler & Pollefeys 2019); the map follows by moving the submaps. Loops must be closed
  /// before. `goes_on` is told the share that is done and says whether to go on; where it says no, what is adjusted so
  /// far is kept. When it fails the poses stay as they are, and a warning tells why.
  Adjusted adjust(const std::function<bool(double)>& goes_on = {});
  /// Fuses all frames again instead of bending submaps (as BundleFusion does: Dai et al. 2017): the keyframes where
  /// they are now, then those between them, each tracked anew against what is fused so far. From here on depth is
  /// corrected by `correction` beside what the rig says, see Adjusted. `again` is the same recording from its begin,
  /// with the same frames held out; `goes_on` is called at each keyframe and at each of its frames, with the number of
  /// frames so far, and says whether to go on. When it says no, or when the work fails, the map stays as it is, and a
  /// warning tells why.
  void reintegrate(Source& again, const DepthCorrection& correction = {}, const std::function<bool(int)>& goes_on = {});

  /// As it was given, and with the correction of depth since then.
  [[nodiscard]] const Rig& rig() const;
  /// Which way up the map stands: how all that map() and trajectory() give is turned, of which gravity is +y where it
  /// is known. Cheap enough to be asked every second.
  [[nodiscard]] Upright upright() const;
  /// From now on it stays as it is known now, in this program and in the session, whatever other recordings tell: call
  /// it when the map's files are written. More frames of the first recording are heard, so that a run which goes on
  /// ends as one that was never cut off. Settles the keyframes, too.
  void settle_upright();
  /// The map as it is now, and always as it is when it is asked.
  [[nodiscard]] Map map();
  /// With EsdfOptions::live the field as of the last frame, in the frame in which the camera is tracked: that of the
  /// world before loops correct it. Null before the first frame, and once it cannot be made. Any thread may ask while
  /// another one adds frames.
  [[nodiscard]] std::shared_ptr<const DistanceField> live_distances() const;

  /// Of all frames that were fused or held out, in the upright world and the colour camera's clock: with Poses::tracked
  /// the depth images' stamps are moved by what the images tell of the two clocks' difference
  /// (Statistics::clock_offset). Frames of components that nothing joins with the largest one are left out.
  /// `recording`: counted from 0 where a session goes on with another one; -1: the last.
  [[nodiscard]] Trajectory trajectory(int recording = -1) const;
  [[nodiscard]] int recordings() const;
  /// The last recording's trajectory for showing it, in the frame in which the camera is tracked: at most `points` of
  /// its poses, two at least, the first and the newest among them.
  [[nodiscard]] Trajectory path(std::size_t points) const;
  /// When the keyframes were taken and how many earlier ones were looked through for their places.
  [[nodiscard]] std::vector<std::pair<double, int>> keyframes() const;
  /// Loops that were found while the frames came, in their order.
  [[nodiscard]] std::vector<FoundLoop> loops() const;
  [[nodiscard]] Statistics statistics() const;
  /// Stages that failed and were switched off since the map can do without them, one line each, in the order in which
  /// it happened.
  [[nodiscard]] const std::vector<std::string>& warnings() const;

  Mapper(Mapper&&) noexcept = default;
  Mapper& operator=(Mapper&&) noexcept = default;

  explicit Mapper(std::shared_ptr<MapState> state);  ///< for the library's own use
  [[nodiscard]] const std::shared_ptr<MapState>& state() const { return state_; }

 private:
  std::shared_ptr<MapState> state_;
};

}  // namespace cairn
