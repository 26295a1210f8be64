// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/eval/evaluation.hpp"

#include <pybind11/stl.h>

#include "cairn/mapping/reports.hpp"
#include "distances.hpp"
#include "frames.hpp"
#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"
#include "trajectory.hpp"

namespace cairn::python {
namespace {

void add_results(py::module_& m) {
  py::class_<ErrorStatistics>(m, "ErrorStatistics", "Statistics of a set of errors.")
      .def_readonly("rmse", &ErrorStatistics::rmse)
      .def_readonly("mean", &ErrorStatistics::mean)
      .def_readonly("median", &ErrorStatistics::median)
      .def_readonly("p95", &ErrorStatistics::p95, "95th percentile.")
      .def_readonly("max", &ErrorStatistics::max)
      .def_readonly("count", &ErrorStatistics::count)
      .def("__repr__", [](const ErrorStatistics& e) {
        return repr("ErrorStatistics", {{"rmse", e.rmse},
                                        {"mean", e.mean},
                                        {"median", e.median},
                                        {"p95", e.p95},
                                        {"max", e.max},
                                        {"count", e.count}});
      });
  py::class_<TrajectoryError>(m, "TrajectoryError", "ATE and RPE as defined by the TUM benchmark (Sturm et al. 2012).")
      .def_readonly("ate", &TrajectoryError::ate, "Meters, after the alignment of Horn 1987.")
      .def_readonly("rpe_translation", &TrajectoryError::rpe_translation, "Meters over rpe_interval.")
      .def_readonly("rpe_rotation", &TrajectoryError::rpe_rotation, "Radians over rpe_interval.")
      .def_readonly("rpe_interval", &TrajectoryError::rpe_interval, "Seconds.")
      .def_readonly("estimated_poses", &TrajectoryError::estimated_poses)
      .def_readonly("matched_poses", &TrajectoryError::matched_poses,
                    "Number of estimated poses matched one to one with true poses.")
      .def_property_readonly(
          "truth_from_estimate", [](const TrajectoryError& e) { return to_numpy(e.truth_from_estimate); },
          "(4, 4) float64: alignment of the trajectories.")
      .def("__repr__", [](const TrajectoryError& e) {
        return repr("TrajectoryError",
                    {{"ate", e.ate}, {"rpe_translation", e.rpe_translation}, {"matched_poses", e.matched_poses}});
      });
  py::class_<MeshError::AtThreshold>(m, "AtThreshold", "Fractions of the surfaces within a distance of each other.")
      .def_readonly("threshold", &MeshError::AtThreshold::threshold, "Meters.")
      .def_readonly("precision", &MeshError::AtThreshold::precision)
      .def_readonly("recall", &MeshError::AtThreshold::recall)
      .def_readonly("f_score", &MeshError::AtThreshold::f_score)
      .def("__repr__", [](const MeshError::AtThreshold& t) {
        return repr(
            "AtThreshold",
            {{"threshold", t.threshold}, {"precision", t.precision}, {"recall", t.recall}, {"f_score", t.f_score}});
      });
  py::class_<MeshError>(m, "MeshError", "Errors of a surface against the true surface.")
      .def_readonly("accuracy", &MeshError::accuracy, "Meters, from samples of the estimate to the true surface.")
      .def_readonly("completeness", &MeshError::completeness,
                    "Meters, from samples of the true surface to the estimate.")
      .def_property_readonly(
          "at", [](const MeshError& e) { return py::tuple(py::cast(e.at)); }, "AtThreshold for 1, 2 and 5 cm.")
      .def("__repr__", [](const MeshError& e) {
        return repr("MeshError", {{"accuracy", e.accuracy}, {"completeness", e.completeness}});
      });
  py::class_<MeshTopology>(m, "MeshTopology", "Topology of a mesh.")
      .def_readonly("non_manifold_edges", &MeshTopology::non_manifold_edges,
                    "Number of edges with more than two triangles.")
      .def_readonly("non_manifold_vertices", &MeshTopology::non_manifold_vertices,
                    "Number of vertices whose triangles are not all connected by edges at the vertex.")
      .def_readonly("coincident_triangles", &MeshTopology::coincident_triangles,
                    "Number of triangles with the three vertices of another triangle.")
      .def_readonly("degenerate_triangles", &MeshTopology::degenerate_triangles)
      .def_readonly("unreferenced_vertices", &MeshTopology::unreferenced_vertices)
      .def_readonly("components", &MeshTopology::components, "Number of connected components, by shared vertices.")
      .def_readonly("borders", &MeshTopology::borders)
      .def_readonly("border_edges", &MeshTopology::border_edges)
      .def_readonly("border_length", &MeshTopology::border_length, "Meters.")
      .def("__repr__", [](const MeshTopology& t) {
        return repr(
            "MeshTopology",
            {{"components", t.components}, {"non_manifold_edges", t.non_manifold_edges}, {"borders", t.borders}});
      });
  py::class_<DistanceError>(m, "DistanceError", "Errors of a distance field against a scene's exact distances.")
      .def_readonly("distance", &DistanceError::distance, "Absolute errors, meters.")
      .def_readonly("within_voxel", &DistanceError::within_voxel, "Fraction of errors below a voxel.")
      .def_readonly("gradient_mean", &DistanceError::gradient_mean,
                    "Mean angle between the field's and the true gradient, radians.")
      .def_readonly("right_signs", &DistanceError::right_signs)
      .def_readonly("signs", &DistanceError::signs)
      .def_readonly("known", &DistanceError::known, "Number of points compared.")
      .def("__repr__", [](const DistanceError& e) {
        return repr("DistanceError", {{"distance", e.distance}, {"within_voxel", e.within_voxel}});
      });
  py::class_<LoopError>(m, "LoopError", "Precision and recall of loop closures.")
      .def_readonly("loops", &LoopError::loops)
      .def_readonly("right", &LoopError::right,
                    "Number of loop closures within 10 cm and 5 degrees of the true relative pose.")
      .def_readonly("revisits", &LoopError::revisits, "Number of keyframes that see an earlier place.")
      .def_readonly("found", &LoopError::found, "Number of revisits with a correct loop closure.")
      .def("__repr__", [](const LoopError& e) {
        return repr("LoopError",
                    {{"loops", e.loops}, {"right", e.right}, {"revisits", e.revisits}, {"found", e.found}});
      });
  py::class_<ViewError>(m, "ViewError", "Error of renderings of a mesh against the images of a recording.")
      .def_readonly("psnr", &ViewError::psnr, "Peak signal-to-noise ratio, dB.")
      .def_readonly("psnr_with_gain", &ViewError::psnr_with_gain, "The same after a gain per image and channel, dB.")
      .def_readonly("covered", &ViewError::covered,
                    "Fraction of the depth pixels within 5 cm of the mesh; only these are compared.")
      .def_readonly("depth_rmse", &ViewError::depth_rmse,
                    "From the measured depth to the rendered surface, where within 10 cm; meters.")
      .def_readonly("frames", &ViewError::frames)
      .def("__repr__", [](const ViewError& e) {
        return repr("ViewError", {{"psnr", e.psnr}, {"covered", e.covered}, {"frames", e.frames}});
      });
}

void add_functions(py::module_& m) {
  m.def(
      "evaluate_trajectory",
      [](const StampedPoses& estimate, const StampedPoses& truth, double interval, double difference) {
        const py::gil_scoped_release release;
        return evaluate_trajectory(estimate.poses, truth.poses, interval, difference);
      },
      py::arg("estimate"), py::arg("truth"), py::arg("rpe_interval") = 1.0, py::arg("max_time_difference") = 0.02,
      "evaluate_trajectory(estimate, truth, rpe_interval=1.0, max_time_difference=0.02)\n--\n\n");
  m.def(
      "estimate_from_truth",
      [](const StampedPoses& estimate, const StampedPoses& truth) {
        return to_numpy(estimate_from_truth(estimate.poses, truth.poses));
      },
      py::arg("estimate"), py::arg("truth"), "estimate_from_truth(estimate, truth)\n--\n\n");
  m.def(
      "evaluate_mesh",
      [](const Mesh& estimate, const Mesh& truth, int samples, const Mesh* seen) {
        const py::gil_scoped_release release;
        return evaluate_mesh(estimate, truth, samples, seen);
      },
      py::arg("estimate"), py::arg("truth"), py::arg("samples") = 200000, py::arg("seen") = nullptr,
      "evaluate_mesh(estimate, truth, samples=200000, seen=None)\n--\n\n");
  m.def(
      "examine_topology",
      [](const Mesh& mesh) {
        const py::gil_scoped_release release;
        return examine_topology(mesh);
      },
      py::arg("mesh"), "examine_topology(mesh)\n--\n\n");
  m.def(
      "evaluate_distances",
      [](const Field& field, const Scene& scene, const Mesh& seen) {
        const py::gil_scoped_release release;
        return evaluate_distances(*field.field, scene, seen);
      },
      py::arg("field"), py::arg("scene"), py::arg("seen"), "evaluate_distances(field, scene, seen)\n--\n\n");
  m.def(
      "evaluate_loops",
      [](const std::vector<FoundLoop>& loops, const std::vector<std::pair<double, int>>& keyframes,
         const StampedPoses& truth, double difference) {
        std::vector<MeasuredLoop> measured;
        for (const FoundLoop& loop : loops)
          if (loop.inlier) measured.push_back({loop.from, loop.to, loop.i_from_j});
        std::vector<KeyframeInfo> infos;
        for (const auto& [timestamp, searched] : keyframes) infos.push_back({timestamp, searched});
        const py::gil_scoped_release release;
        return evaluate_loops(measured, infos, truth.poses, difference);
      },
      py::arg("loops"), py::arg("keyframes"), py::arg("truth"), py::arg("max_time_difference") = 0.1,
      "evaluate_loops(loops, keyframes, truth, max_time_difference=0.1)\n--\n\n");
  m.def(
      "evaluate_views",
      [](const std::vector<Mesh>& parts, GuardedSource& recording, const py::object& world_from_recording, int step) {
        const Eigen::Isometry3d move = world_from_recording.is_none()
                                           ? Eigen::Isometry3d(Eigen::Isometry3d::Identity())
                                           : pose_of(world_from_recording, "world_from_recording");
        return recording.guard->run([&] { return evaluate_views(parts, *recording.source, move, step); });
      },
      py::arg("parts"), py::arg("recording"), py::arg("world_from_recording") = py::none(), py::arg("step") = 10,
      "evaluate_views(parts, recording, world_from_recording=None, step=10)\n--\n\n");
}

}  // namespace

void add_evaluation(py::module_& m) {
  add_results(m);
  add_functions(m);
}

}  // namespace cairn::python
