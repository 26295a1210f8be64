// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/evaluation.hpp"

#include <pybind11/stl.h>

#include "cairn/reports.hpp"
#include "distances.hpp"
#include "frames.hpp"
#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"
#include "trajectory.hpp"

namespace cairn::python {
namespace {

void add_results(py::module_& m) {
  py::class_<ErrorStatistics>(m, "ErrorStatistics", "Errors in a few numbers.")
      .def_readonly("rmse", &ErrorStatistics::rmse)
      .def_readonly("mean", &ErrorStatistics::mean)
      .def_readonly("median", &ErrorStatistics::median)
      .def_readonly("p95", &ErrorStatistics::p95, "That 95 % do not exceed.")
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
  py::class_<TrajectoryError>(m, "TrajectoryError",
                              "ATE and RPE as the TUM benchmark defines them (Sturm et al. 2012).")
      .def_readonly("ate", &TrajectoryError::ate, "Metres, after the alignment of Horn 1987.")
      .def_readonly("rpe_translation", &TrajectoryError::rpe_translation, "Metres over rpe_interval.")
      .def_readonly("rpe_rotation", &TrajectoryError::rpe_rotation, "Radians over rpe_interval.")
      .def_readonly("rpe_interval", &TrajectoryError::rpe_interval, "Seconds.")
      .def_readonly("estimated_poses", &TrajectoryError::estimated_poses)
      .def_readonly("matched_poses", &TrajectoryError::matched_poses, "Of them, with a true pose, one to one.")
      .def_property_readonly(
          "truth_from_estimate", [](const TrajectoryError& e) { return to_numpy(e.truth_from_estimate); },
          "(4, 4) float64.")
      .def("__repr__", [](const TrajectoryError& e) {
        return repr("TrajectoryError",
                    {{"ate", e.ate}, {"rpe_translation", e.rpe_translation}, {"matched_poses", e.matched_poses}});
      });
  py::class_<MeshError::AtThreshold>(m, "AtThreshold", "Shares of the surfaces within a distance of each other.")
      .def_readonly("threshold", &MeshError::AtThreshold::threshold, "Metres.")
      .def_readonly("precision", &MeshError::AtThreshold::precision)
      .def_readonly("recall", &MeshError::AtThreshold::recall)
      .def_readonly("f_score", &MeshError::AtThreshold::f_score)
      .def("__repr__", [](const MeshError::AtThreshold& t) {
        return repr(
            "AtThreshold",
            {{"threshold", t.threshold}, {"precision", t.precision}, {"recall", t.recall}, {"f_score", t.f_score}});
      });
  py::class_<MeshError>(m, "MeshError", "How well two surfaces agree.")
      .def_readonly("accuracy", &MeshError::accuracy, "Metres, from samples of the estimate to the truth's surface.")
      .def_readonly("completeness", &MeshError::completeness,
                    "Metres, from samples of the truth to the estimate's surface.")
      .def_property_readonly(
          "at", [](const MeshError& e) { return py::tuple(py::cast(e.at)); }, "AtThreshold for 1, 2 and 5 cm.")
      .def("__repr__", [](const MeshError& e) {
        return repr("MeshError", {{"accuracy", e.accuracy}, {"completeness", e.completeness}});
      });
  py::class_<MeshTopology>(m, "MeshTopology", "How a mesh's triangles hang together.")
      .def_readonly("non_manifold_edges", &MeshTopology::non_manifold_edges, "Of more than two triangles.")
      .def_readonly("non_manifold_vertices", &MeshTopology::non_manifold_vertices,
                    "Whose triangles do not all hang together by sides that end there.")
      .def_readonly("coincident_triangles", &MeshTopology::coincident_triangles,
                    "With the three vertices of another one.")
      .def_readonly("degenerate_triangles", &MeshTopology::degenerate_triangles)
      .def_readonly("unreferenced_vertices", &MeshTopology::unreferenced_vertices)
      .def_readonly("components", &MeshTopology::components, "That no vertex joins.")
      .def_readonly("borders", &MeshTopology::borders)
      .def_readonly("border_edges", &MeshTopology::border_edges)
      .def_readonly("border_length", &MeshTopology::border_length, "Metres.")
      .def("__repr__", [](const MeshTopology& t) {
        return repr(
            "MeshTopology",
            {{"components", t.components}, {"non_manifold_edges", t.non_manifold_edges}, {"borders", t.borders}});
      });
  py::class_<DistanceError>(m, "DistanceError", "A distance field against a scene's exact distances.")
      .def_readonly("distance", &DistanceError::distance, "Metres, absolute.")
      .def_readonly("within_voxel", &DistanceError::within_voxel, "Share of these that are less than a voxel.")
      .def_readonly("gradient_mean", &DistanceError::gradient_mean,
                    "Radians between the field's gradient and the true one.")
      .def_readonly("right_signs", &DistanceError::right_signs)
      .def_readonly("signs", &DistanceError::signs)
      .def_readonly("known", &DistanceError::known, "Points looked at.")
      .def("__repr__", [](const DistanceError& e) {
        return repr("DistanceError", {{"distance", e.distance}, {"within_voxel", e.within_voxel}});
      });
  py::class_<LoopError>(m, "LoopError", "How well places were recognised.")
      .def_readonly("loops", &LoopError::loops)
      .def_readonly("right", &LoopError::right, "Within 10 cm and 5 degrees of the true one.")
      .def_readonly("revisits", &LoopError::revisits, "Keyframes that look at an earlier place.")
      .def_readonly("found", &LoopError::found, "Those of them with a right loop.")
      .def("__repr__", [](const LoopError& e) {
        return repr("LoopError",
                    {{"loops", e.loops}, {"right", e.right}, {"revisits", e.revisits}, {"found", e.found}});
      });
  py::class_<ViewError>(m, "ViewError", "How well pictures of a mesh agree with a recording's.")
      .def_readonly("psnr", &ViewError::psnr, "dB.")
      .def_readonly("covered", &ViewError::covered,
                    "Share of the depth pixels where the mesh lies within 5 cm: these are compared.")
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
        std::vector<LoopMeasured> measured;
        for (const FoundLoop& loop : loops)
          if (loop.inlier) measured.push_back({loop.from, loop.to, loop.i_from_j});
        const py::gil_scoped_release release;
        return evaluate_loops(measured, keyframes, truth.poses, difference);
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
