// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/reports.hpp"

#include <pybind11/stl.h>

#include <array>

#include "cairn/session.hpp"
#include "cairn/upright.hpp"
#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

void add_frame_report(py::module_& m) {
  py::class_<AlignmentFit>(m, "AlignmentFit", "How well a frame's surface fits the map where it was aligned.")
      .def_readonly("inlier_share", &AlignmentFit::inlier_share, "Of the points that see the map, those that fit.")
      .def_readonly("overlap", &AlignmentFit::overlap, "Share of the frame's points that see the map.")
      .def_readonly("rmse", &AlignmentFit::rmse, "Of the inliers, standard deviations of the depth noise.")
      .def_readonly("photometric_share", &AlignmentFit::photometric_share,
                    "Of the points with brightness in both images; 0: no color was used.")
      .def_readonly("photometric_rmse", &AlignmentFit::photometric_rmse, "Brightness in 0..1.")
      .def_readonly("degenerate_directions", &AlignmentFit::degenerate_directions,
                    "Of the pose, of 6, that the surface does not determine.")
      .def_readonly("unobserved", &AlignmentFit::unobserved,
                    "Directions, of 6, that were left as the motion before says.")
      .def_readonly("iterations", &AlignmentFit::iterations, "Over all levels.")
      .def("__repr__", [](const AlignmentFit& f) {
        return repr("AlignmentFit", {{"inlier_share", f.inlier_share}, {"overlap", f.overlap}, {"rmse", f.rmse}});
      });
  py::class_<FrameReport>(m, "FrameReport", "What became of one frame, and how well it fits the map.")
      .def_readonly("index", &FrameReport::index)
      .def_readonly("time", &FrameReport::timestamp, "Seconds.")
      .def_property_readonly(
          "state", [](const FrameReport& r) { return std::string(name_of(r.state)); },
          "'fused': it has a pose and is part of the map; 'lost': no trustworthy pose, not fused; 'skipped': it could "
          "not be used at all; 'held_out': it has a pose and is no part of the map (Frame.held_out).")
      .def_readonly("reason", &FrameReport::reason,
                    "Why it is not part of the map, or is so in another way than usual, in words.")
      .def_property_readonly(
          "pose", [](const FrameReport& r) { return to_numpy(r.tracked_from_camera); },
          "(4, 4) float64, metres, or None unless fused or held out: where the depth camera was, in the frame in which "
          "the camera "
          "is tracked. That is the world before loops correct the map and before it is turned upright; "
          "Mapper.trajectory tells the poses of all frames in the world as it is now. With given poses the one that "
          "was given.")
      .def_property_readonly(
          "covariance",
          [](const FrameReport& r) -> py::object {
            return r.covariance ? py::object(to_numpy(*r.covariance)) : py::none();
          },
          "(6, 6) float64 of (rotation, translation) in the camera's frame, rad^2 and m^2, or None where nothing was "
          "aligned: how sure the pose is beside the map. It says nothing of how far the map itself has drifted. What "
          "neither surface nor brightness determines has a deviation of about 1 rad or 1 m; without color a young map "
          "of a bare, noisy wall seems surer than it is.")
      .def_readonly("fit", &FrameReport::fit)
      .def_readonly("moving", &FrameReport::moving, "Share of the image that was left out since it moves.")
      .def_readonly("guess", &FrameReport::guess,
                    "Where the alignment started: motion, still, features, relocalised, gyroscope.")
      .def_readonly("touched_bricks", &FrameReport::touched_bricks, "Of 8x8x8 voxels, that were fused into.")
      .def_readonly("new_bricks", &FrameReport::new_bricks, "Of these.")
      .def_readonly("stage_ms", &FrameReport::stage_ms, "Milliseconds by stage.")
      .def("__repr__", [](const FrameReport& r) {
        return repr("FrameReport",
                    {{"index", r.index}, {"state", std::string(name_of(r.state))}, {"reason", r.reason}});
      });
}

void add_map_reports(py::module_& m) {
  py::class_<Refined>(m, "Refined", "What Mapper.refine did.")
      .def_readonly("keyframes", &Refined::keyframes)
      .def_readonly("pairs_tried", &Refined::pairs_tried, "Of keyframes that see the same.")
      .def_readonly("pairs_aligned", &Refined::pairs_aligned)
      .def_readonly("pairs_inlier", &Refined::pairs_inlier, "Those that the pose graph keeps.")
      .def_readonly("cost_before", &Refined::cost_before)
      .def_readonly("cost", &Refined::cost);
  py::class_<Adjusted>(m, "Adjusted", "What Mapper.adjust did.")
      .def_readonly("keyframes", &Adjusted::keyframes, "That were moved.")
      .def_readonly("surfels", &Adjusted::surfels, "The surface that they see.")
      .def_readonly("observations", &Adjusted::observations, "Of it.")
      .def_readonly("clock_offset", &Adjusted::clock_offset,
                    "Seconds that the color camera's clock is ahead of the depth camera's.")
      .def_readonly("readout", &Adjusted::readout,
                    "Seconds from the first row to the last, beside what the rig says of its shutters.")
      .def_readonly("readout_sigma", &Adjusted::readout_sigma, "Seconds, its standard deviation.")
      .def_readonly("predicts_better", &Adjusted::predicts_better,
                    "Share of what surfels that were held out are off, that the readout takes away.")
      .def_readonly("has_readout", &Adjusted::has_readout, "That confirms it.")
      .def_property_readonly(
          "correction",
          [](const Adjusted& a) { return a.correction.empty() ? std::nullopt : std::optional(a.correction); },
          "What the depth camera errs by, beside what the rig says of it, as a DepthCorrection; None where surfels "
          "that "
          "were held out do not confirm it.")
      .def_readonly("corrected_predicts_better", &Adjusted::corrected_predicts_better,
                    "The same share, that the correction takes away.")
      .def_property_readonly(
          "covariances",
          [](const Adjusted& a) {
            std::vector<std::pair<double, Doubles>> all;
            for (const auto& [timestamp, covariance] : a.covariances) all.emplace_back(timestamp, to_numpy(covariance));
            return all;
          },
          "Of each keyframe its time, and how surely it lies where it is, seen from the first: (6, 6) float64 of what "
          "turns (radians) and moves (meters) it in its own camera's frame.")
      .def("__repr__", [](const Adjusted& a) {
        return repr("Adjusted", {{"keyframes", a.keyframes}, {"surfels", a.surfels}, {"observations", a.observations}});
      });
  py::class_<FoundLoop>(m, "Loop", "Two keyframes that were recognised as views of the same place.")
      .def_readonly("start", &FoundLoop::from, "Time of keyframe i, seconds.")
      .def_readonly("end", &FoundLoop::to, "Time of keyframe j, seconds.")
      .def_property_readonly(
          "i_from_j", [](const FoundLoop& l) { return to_numpy(l.i_from_j); }, "(4, 4) float64, measured.")
      .def_readonly("corners", &FoundLoop::corners, "That agreed.")
      .def_readonly("inlier_share", &FoundLoop::inlier_share)
      .def_readonly("rmse", &FoundLoop::rmse)
      .def_readonly("inlier", &FoundLoop::inlier, "The pose graph keeps it.");
  py::class_<Statistics>(m, "Statistics", "How large a map is, what it cost, and what was learned of the camera.")
      .def_readonly("device", &Statistics::device)
      .def_readonly("device_memory_peak", &Statistics::device_memory_peak, "Bytes.")
      .def_readonly("device_waits", &Statistics::device_waits, "Of the host for the device.")
      .def_readonly("uploaded", &Statistics::uploaded, "Bytes.")
      .def_readonly("downloaded", &Statistics::downloaded, "Bytes.")
      .def_readonly("bricks", &Statistics::bricks, "Of 8x8x8 voxels, that were allocated.")
      .def_readonly("keyframes", &Statistics::keyframes)
      .def_readonly("submaps", &Statistics::submaps, "That ended.")
      .def_readonly("components", &Statistics::components, "Parts of the map that nothing joins.")
      .def_readonly("looked_up", &Statistics::looked_up, "Keyframes looked for among earlier ones.")
      .def_readonly("loops_tried", &Statistics::loops_tried, "Pairs that were aligned.")
      .def_readonly("graph_ms", &Statistics::graph_ms, "The longest optimisation.")
      .def_readonly("clock_offset", &Statistics::clock_offset, "Seconds that the color camera's clock is ahead.")
      .def_property_readonly(
          "focal_scale", [](const Statistics& s) { return s.focal.scale; },
          "The focal length that fits the images best, in units of the camera's.")
      .def_property_readonly("focal_is_doubtful", [](const Statistics& s) { return s.focal.contradicts(); })
      .def_readonly("sigma_median", &Statistics::sigma_median,
                    "Metres: how surely an adjusted map knows its surface, the median; 0: not known.")
      .def_readonly("sigma_95", &Statistics::sigma_95, "What 95 % of the surface lie below.")
      .def("__repr__", [](const Statistics& s) {
        return repr(
            "Statistics",
            {{"keyframes", s.keyframes}, {"submaps", s.submaps}, {"components", s.components}, {"bricks", s.bricks}});
      });
  py::class_<Upright>(m, "Upright", "Which way up a map stands.")
      .def_property_readonly("source", [](const Upright& u) { return std::string(cairn::name_of(u.source)); })
      .def_readonly("known", &Upright::known, "Gravity points along +y of the world that is written.")
      .def_property_readonly(
          "world_from_tracked", [](const Upright& u) { return to_numpy(Eigen::Isometry3d(u.world_from_tracked)); },
          "(4, 4) float64: from the frame in which the camera is tracked to the world that is written.")
      .def_readonly("words", &Upright::words, "A line for people.")
      .def("__repr__", [](const Upright& u) { return "Upright: " + u.words; });
  py::class_<Session::Merged>(m, "Merged", "What Session.merge found.")
      .def_readonly("compared", &Session::Merged::compared, "Keyframes of the other session.")
      .def_readonly("loops", &Session::Merged::loops, "To this session.")
      .def_readonly("joined", &Session::Merged::joined, "The loops that agree join the two.")
      .def("__repr__", [](const Session::Merged& r) {
        return repr("Merged", {{"compared", r.compared}, {"loops", r.loops}, {"joined", r.joined}});
      });
}

}  // namespace

void add_reports(py::module_& m) {
  add_frame_report(m);
  add_map_reports(m);
}

}  // namespace cairn::python
