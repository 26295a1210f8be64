// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/reports.hpp"

#include <pybind11/stl.h>

#include <array>

#include "cairn/mapping/gravity_alignment.hpp"
#include "cairn/mapping/session.hpp"
#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

void add_frame_report(py::module_& m) {
  py::class_<AlignmentFit>(m, "AlignmentFit", "Quality of a frame's alignment with the map.")
      .def_readonly("inlier_share", &AlignmentFit::inlier_share,
                    "Fraction of inliers among the points that see the map.")
      .def_readonly("overlap", &AlignmentFit::overlap, "Fraction of the frame's points that see the map.")
      .def_readonly("rmse", &AlignmentFit::rmse, "RMSE of the inliers, in standard deviations of the depth noise.")
      .def_readonly("photometric_share", &AlignmentFit::photometric_share,
                    "Fraction of the points with brightness in both images; 0: no color was used.")
      .def_readonly("photometric_rmse", &AlignmentFit::photometric_rmse, "RMSE of brightness, 0 to 1.")
      .def_readonly("degenerate_directions", &AlignmentFit::degenerate_directions,
                    "Number of pose directions, of 6, not determined by the surface.")
      .def_readonly("unobserved", &AlignmentFit::unobserved,
                    "Number of pose directions, of 6, set by the motion prediction.")
      .def_readonly("iterations", &AlignmentFit::iterations, "Number of iterations over all levels.")
      .def("__repr__", [](const AlignmentFit& f) {
        return repr("AlignmentFit", {{"inlier_share", f.inlier_share}, {"overlap", f.overlap}, {"rmse", f.rmse}});
      });
  py::class_<FrameReport>(m, "FrameReport", "Result of one frame: outcome, pose and quality.")
      .def_readonly("index", &FrameReport::index)
      .def_readonly("time", &FrameReport::timestamp, "Seconds.")
      .def_property_readonly(
          "state", [](const FrameReport& r) { return std::string(to_string(r.state)); },
          "'fused': has a pose and was integrated into the map; 'lost': no reliable pose; 'skipped': unusable frame; "
          "'held_out': has a pose, not integrated (Frame.held_out).")
      .def_readonly("reason", &FrameReport::reason,
                    "Reason for a frame that was not integrated, or only partly, with the measured value.")
      .def_property_readonly(
          "pose", [](const FrameReport& r) { return to_numpy(r.tracked_from_camera); },
          "(4, 4) float64, meters: pose of the depth camera in the tracking frame, the world before loop corrections "
          "and "
          "gravity alignment; with given poses the given pose. None unless fused or held out. Mapper.trajectory has "
          "the "
          "poses of all frames in the current world.")
      .def_property_readonly(
          "covariance",
          [](const FrameReport& r) -> py::object {
            return r.covariance ? py::object(to_numpy(*r.covariance)) : py::none();
          },
          "(6, 6) float64 of (rotation, translation) in the camera's frame, rad^2 and m^2: covariance of the pose "
          "relative "
          "to the map, without the map's drift. None without an alignment. Directions determined by neither surface "
          "nor "
          "brightness have a standard deviation of about 1 rad or 1 m. Without color, the covariance is too small "
          "along "
          "a bare, noisy wall while the map is young.")
      .def_readonly("fit", &FrameReport::fit)
      .def_readonly("moving", &FrameReport::moving, "Fraction of the image excluded as moving.")
      .def_property_readonly(
          "guess", [](const FrameReport& r) { return std::string(to_string(r.guess)); },
          "Initial guess of the alignment: motion, still, features, relocalized, gyroscope.")
      .def_readonly("touched_bricks", &FrameReport::touched_bricks,
                    "Number of bricks of 8x8x8 voxels that received measurements.")
      .def_readonly("new_bricks", &FrameReport::new_bricks, "Number of new bricks among them.")
      .def_readonly("stage_ms", &FrameReport::stage_ms, "Milliseconds by stage.")
      .def("__repr__", [](const FrameReport& r) {
        return repr("FrameReport",
                    {{"index", r.index}, {"state", std::string(to_string(r.state))}, {"reason", r.reason}});
      });
}

void add_map_reports(py::module_& m) {
  py::class_<RefineReport>(m, "RefineReport", "Result of Mapper.refine.")
      .def_readonly("keyframes", &RefineReport::keyframes)
      .def_readonly("pairs_tried", &RefineReport::pairs_tried, "Number of covisible keyframe pairs.")
      .def_readonly("pairs_aligned", &RefineReport::pairs_aligned)
      .def_readonly("pairs_inlier", &RefineReport::pairs_inlier, "Number of aligned pairs kept by the pose graph.")
      .def_readonly("cost_before", &RefineReport::cost_before)
      .def_readonly("cost", &RefineReport::cost);
  py::class_<AdjustReport>(m, "AdjustReport", "Result of Mapper.adjust.")
      .def_readonly("keyframes", &AdjustReport::keyframes, "Number of adjusted keyframes.")
      .def_readonly("surfels", &AdjustReport::surfels, "Number of surfels of the observed surface.")
      .def_readonly("observations", &AdjustReport::observations, "Number of observations of the surfels.")
      .def_readonly("clock_offset", &AdjustReport::clock_offset,
                    "Seconds by which the color camera's clock is ahead of the depth camera's.")
      .def_readonly("readout", &AdjustReport::readout,
                    "Seconds from the first row to the last, added to the rig's readout.")
      .def_readonly("readout_sigma", &AdjustReport::readout_sigma, "Standard deviation of the readout, seconds.")
      .def_readonly("error_reduction", &AdjustReport::error_reduction,
                    "Relative reduction of held-out surfel errors by the readout.")
      .def_readonly("has_readout", &AdjustReport::has_readout, "True if held-out surfels confirm the readout.")
      .def_property_readonly(
          "correction",
          [](const AdjustReport& a) { return a.correction.empty() ? std::nullopt : std::optional(a.correction); },
          "DepthCorrection in addition to the rig's; None if held-out surfels do not confirm it.")
      .def_readonly("corrected_error_reduction", &AdjustReport::corrected_error_reduction,
                    "Relative reduction of held-out surfel errors by the correction.")
      .def_property_readonly(
          "covariances",
          [](const AdjustReport& a) {
            std::vector<std::pair<double, Doubles>> all;
            for (const auto& [timestamp, covariance] : a.covariances) all.emplace_back(timestamp, to_numpy(covariance));
            return all;
          },
          "List of (time, covariance) of the adjusted keyframes: covariance of the pose relative to the first "
          "keyframe, "
          "(6, 6) float64 of (rotation, translation) in the camera's frame, rad^2 and m^2.")
      .def("__repr__", [](const AdjustReport& a) {
        return repr("AdjustReport",
                    {{"keyframes", a.keyframes}, {"surfels", a.surfels}, {"observations", a.observations}});
      });
  py::class_<HeldOutError>(m, "HeldOutError", "Errors of a map at held-out frames.")
      .def_readonly("frames", &HeldOutError::frames, "Number of compared frames.")
      .def_readonly("covered", &HeldOutError::covered,
                    "Share of the measured points with a surface within the truncation.")
      .def_readonly("depth_rmse", &HeldOutError::depth_rmse, "Meters, from these points to the surface.")
      .def_readonly("brightness_rmse", &HeldOutError::brightness_rmse,
                    "0 to 1, between images and the voxels' colors; 0: no color aligned with depth.")
      .def_readonly("doubled", &HeldOutError::doubled,
                    "Share of these points with another surface within 8 cm along their ray.")
      .def("__repr__", [](const HeldOutError& e) {
        return repr("HeldOutError", {{"frames", e.frames}, {"depth_rmse", e.depth_rmse}, {"doubled", e.doubled}});
      });
  py::class_<FinishReport>(m, "FinishReport", "Result of Mapper.finish.")
      .def_readonly("refined", &FinishReport::refined,
                    "RefineReport; None if not requested, or skipped after a cancellation.")
      .def_readonly("adjusted", &FinishReport::adjusted,
                    "AdjustReport; None if not requested, or skipped after a cancellation.")
      .def_readonly("is_reintegrated", &FinishReport::is_reintegrated, "True if all frames were fused again.")
      .def_readonly("has_fused_held_out", &FinishReport::has_fused_held_out, "True if these include held-out frames.")
      .def_readonly("error_before", &FinishReport::error_before,
                    "HeldOutError before the stages of a quality; None with too few held-out frames.")
      .def_readonly("error", &FinishReport::error, "The same after the stages.")
      .def_readonly("is_kept", &FinishReport::is_kept,
                    "False if held-out frames did not confirm the stages; the map is then as before.");
  py::class_<FoundLoop>(m, "Loop", "Loop closure between two keyframes.")
      .def_readonly("start", &FoundLoop::from, "Timestamp of keyframe i, seconds.")
      .def_readonly("end", &FoundLoop::to, "Timestamp of keyframe j, seconds.")
      .def_property_readonly(
          "i_from_j", [](const FoundLoop& l) { return to_numpy(l.i_from_j); },
          "(4, 4) float64, measured pose of j in the frame of i.")
      .def_readonly("feature_inliers", &FoundLoop::feature_inliers, "Number of feature inliers.")
      .def_readonly("inlier_share", &FoundLoop::inlier_share)
      .def_readonly("rmse", &FoundLoop::rmse)
      .def_readonly("inlier", &FoundLoop::inlier, "True if the pose graph keeps it.");
  py::class_<InertialReport>(m, "InertialReport", "Inertial sensors, as estimated with the tracked motion.")
      .def_property_readonly(
          "state", [](const InertialReport& r) { return std::string(cairn::to_string(r.state)); },
          "'absent', 'untested', 'trusted' or 'contradicted'.")
      .def_property_readonly(
          "gyroscope_bias", [](const InertialReport& r) { return to_numpy(r.gyroscope_bias); },
          "(3,) float64, rad/s, in axes of the depth camera.")
      .def_property_readonly(
          "accelerometer_bias", [](const InertialReport& r) { return to_numpy(r.accelerometer_bias); },
          "(3,) float64, m/s^2, same axes.")
      .def_property_readonly(
          "imu_from_camera", [](const InertialReport& r) { return to_numpy(Eigen::Isometry3d(r.imu_from_camera)); },
          "(4, 4) float64: rotation of the sensor against the rig's axes.")
      .def_property_readonly(
          "lever", [](const InertialReport& r) { return to_numpy(r.lever); },
          "(3,) float64, of the camera from the sensor, m, same axes.")
      .def_readonly("clock", &InertialReport::clock, "Seconds by which the camera's clock is behind.")
      .def_readonly("gravity_sigma", &InertialReport::gravity_sigma, "rad")
      .def("__repr__", [](const InertialReport& r) { return "InertialReport: " + std::string(to_string(r.state)); });
  py::class_<Statistics>(m, "Statistics", "Size and cost of a map, and estimates about the camera.")
      .def_readonly("device", &Statistics::device)
      .def_readonly("device_memory_peak", &Statistics::device_memory_peak, "Bytes.")
      .def_readonly("device_waits", &Statistics::device_waits, "Number of waits of the host for the device.")
      .def_readonly("uploaded", &Statistics::uploaded, "Bytes to the device.")
      .def_readonly("downloaded", &Statistics::downloaded, "Bytes from the device.")
      .def_readonly("bricks", &Statistics::bricks, "Number of allocated bricks of 8x8x8 voxels.")
      .def_readonly("keyframes", &Statistics::keyframes)
      .def_readonly("submaps", &Statistics::submaps, "Number of ended submaps.")
      .def_readonly("components", &Statistics::components, "Number of components of the map.")
      .def_readonly("database_queries", &Statistics::database_queries,
                    "Number of keyframes searched for in the keyframe database.")
      .def_readonly("loops_tried", &Statistics::loops_tried, "Number of keyframe pairs aligned.")
      .def_readonly("graph_ms", &Statistics::graph_ms, "Longest pose graph optimization, milliseconds.")
      .def_readonly("clock_offset", &Statistics::clock_offset, "Seconds by which the color camera's clock is ahead.")
      .def_property_readonly(
          "focal_scale", [](const Statistics& s) { return s.focal.scale; },
          "Focal length with the best fit to the images, relative to the camera's.")
      .def_property_readonly("focal_is_doubtful", [](const Statistics& s) { return s.focal.contradicts(); })
      .def_readonly("inertial", &Statistics::inertial, "InertialReport.")
      .def_readonly("sigma_median", &Statistics::sigma_median,
                    "Standard deviation of an adjusted map's surface, meters: median; 0: unknown.")
      .def_readonly("sigma_95", &Statistics::sigma_95, "The same, 95th percentile.")
      .def("__repr__", [](const Statistics& s) {
        return repr(
            "Statistics",
            {{"keyframes", s.keyframes}, {"submaps", s.submaps}, {"components", s.components}, {"bricks", s.bricks}});
      });
  py::class_<GravityAlignment>(m, "GravityAlignment", "Gravity alignment of a map.")
      .def_property_readonly("source",
                             [](const GravityAlignment& u) { return std::string(cairn::to_string(u.source)); })
      .def_readonly("known", &GravityAlignment::known, "True if gravity is along +y of the exported world.")
      .def_property_readonly(
          "world_from_tracked",
          [](const GravityAlignment& u) { return to_numpy(Eigen::Isometry3d(u.world_from_tracked)); },
          "(4, 4) float64: rotation from the tracking frame to the exported world.")
      .def_readonly("description", &GravityAlignment::description,
                    "Evidence, or the missing data and the remedy, in one line.")
      .def_readonly("words", &GravityAlignment::description, "Earlier name of description.")
      .def("__repr__", [](const GravityAlignment& u) { return "GravityAlignment: " + u.description; });
}

}  // namespace

void add_reports(py::module_& m) {
  add_frame_report(m);
  add_map_reports(m);
}

}  // namespace cairn::python
