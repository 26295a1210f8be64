// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>

#include "cairn/pose_graph.hpp"
#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

std::size_t expect_node(const PoseGraph& graph, std::size_t node) {
  if (node < graph.world_from_node.size()) return node;
  throw py::index_error("there is no node " + std::to_string(node) + " of " +
                        std::to_string(graph.world_from_node.size()));
}

Doubles poses_of(const std::vector<Eigen::Isometry3d>& poses) {
  Doubles array({static_cast<py::ssize_t>(poses.size()), py::ssize_t{4}, py::ssize_t{4}});
  double* to = array.mutable_data();
  for (const Eigen::Isometry3d& pose : poses) {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = pose.matrix();
    to = std::copy_n(matrix.data(), 16, to);
  }
  return array;
}

void add_parts(py::module_& m) {
  using Edge = PoseGraph::Edge;
  py::class_<Edge>(m, "Edge", "A measurement of how two nodes lie to one another.")
      .def_readonly("i", &Edge::i, "Node.")
      .def_readonly("j", &Edge::j, "Node.")
      .def_property_readonly(
          "i_from_j", [](const Edge& e) { return to_numpy(e.i_from_j); },
          "(4, 4) float64: measured pose of j in the frame of i.")
      .def_property_readonly(
          "information", [](const Edge& e) { return to_numpy(e.information); },
          "(6, 6) float64 of (rotation, translation) in the frame of j, 1/rad^2 and 1/m^2.")
      .def_readonly("is_loop", &Edge::is_loop_closure, "It may be no measurement of this pair.")
      .def("__repr__", [](const Edge& e) {
        return repr("Edge", {{"i", e.i}, {"j", e.j}, {"is_loop", e.is_loop_closure}});
      });
  py::class_<OptimiseReport>(m, "OptimizeReport", "What PoseGraph.optimize did.")
      .def_readonly("cost_before", &OptimiseReport::cost_before,
                    "Half the sum of squared errors in units of their noise.")
      .def_readonly("cost", &OptimiseReport::cost, "The same afterwards.")
      .def_readonly("iterations", &OptimiseReport::iterations)
      .def_readonly("components", &OptimiseReport::components,
                    "Parts that no edge joins; the first node of each stays.")
      .def_readonly("from_chordal", &OptimiseReport::from_chordal, "It started from the chordal initialisation.")
      .def_property_readonly(
          "edge_weights",
          [](const OptimiseReport& r) {
            return Doubles(static_cast<py::ssize_t>(r.edge_weights.size()), r.edge_weights.data());
          },
          "(edges,) float64; 1: believed, 0: false.")
      .def_readonly("seconds", &OptimiseReport::seconds)
      .def("__repr__", [](const OptimiseReport& r) {
        return repr("OptimizeReport", {{"cost_before", r.cost_before}, {"cost", r.cost}, {"iterations", r.iterations}});
      });
}

}  // namespace

void add_graph(py::module_& m) {
  add_parts(m);
  py::class_<PoseGraph>(m, "PoseGraph", R"(PoseGraph()
--

Poses bound to each other by measurements of how they lie to one another.)")
      .def(py::init<>(), R"(__init__(self)
--

)")
      .def(
          "add_node",
          [](PoseGraph& g, const py::object& pose) {
            g.world_from_node.push_back(pose_of(pose, "pose"));
            return g.world_from_node.size() - 1;
          },
          py::arg("pose"), R"(add_node(self, pose)
--

Adds a node at a first guess of its pose, (4, 4), world_from_node. Returns its number.)")
      .def(
          "add_edge",
          [](PoseGraph& g, std::size_t i, std::size_t j, const py::object& i_from_j, const py::object& information,
             bool is_loop) {
            g.edges.push_back(
                {expect_node(g, i), expect_node(g, j), pose_of(i_from_j, "i_from_j"),
                 information.is_none() ? Matrix6d(Matrix6d::Identity()) : matrix6_of(information, "information"),
                 is_loop});
          },
          py::arg("i"), py::arg("j"), py::arg("i_from_j"), py::arg("information") = py::none(), py::kw_only(),
          py::arg("is_loop") = false,
          R"(add_edge(self, i, j, i_from_j, information=None, *, is_loop=False)
--

Adds a measurement. i_from_j: (4, 4), pose of node j in the frame of node i. information: (6, 6) of (rotation,
translation) in the frame of j, 1/rad^2 and 1/m^2; without it the identity. is_loop: the optimiser may find that it is
no measurement of this pair.)")
      .def(
          "add_gravity",
          [](PoseGraph& g, std::size_t node, const py::object& up, double sigma) {
            g.gravity.push_back({expect_node(g, node), vector_of(up, "up").normalized(), sigma});
          },
          py::arg("node"), py::arg("up"), py::arg("sigma") = PoseGraph::Gravity{}.sigma,
          R"(add_gravity(self, node, up, sigma=0.02)
--

Adds what an accelerometer reads at rest: up, (3,), in the node's frame; in the world up is -y. sigma: radians.)")
      .def_property_readonly(
          "poses", [](const PoseGraph& g) { return poses_of(g.world_from_node); },
          "(N, 4, 4) float64, world_from_node: a copy.")
      .def(
          "set_pose",
          [](PoseGraph& g, std::size_t node, const py::object& pose) {
            g.world_from_node[expect_node(g, node)] = pose_of(pose, "pose");
          },
          py::arg("node"), py::arg("pose"), R"(set_pose(self, node, pose)
--

Moves a node.)")
      .def_property_readonly(
          "edges", [](const PoseGraph& g) { return g.edges; }, "A list of Edge: a copy.")
      .def(
          "optimize",
          [](PoseGraph& g, bool robust, double inlier_threshold, int max_iterations) {
            PoseGraph moved = g;  // other threads may add nodes meanwhile
            OptimiseReport report;
            {
              const py::gil_scoped_release release;
              report = optimise(
                  moved, {.robust = robust, .inlier_threshold = inlier_threshold, .max_iterations = max_iterations});
            }
            std::copy(moved.world_from_node.begin(), moved.world_from_node.end(), g.world_from_node.begin());
            return report;
          },
          py::kw_only(), py::arg("robust") = OptimiseOptions{}.robust,
          py::arg("inlier_threshold") = OptimiseOptions{}.inlier_threshold,
          py::arg("max_iterations") = OptimiseOptions{}.max_iterations,
          R"(optimize(self, *, robust=True, inlier_threshold=22.46, max_iterations=100)
--

Moves the poses to the minimum of the sum of squared errors (Levenberg-Marquardt on SE(3)). robust: weighs loops that may
be false by graduated non-convexity. inlier_threshold: squared error, in units of an edge's own noise, beyond which it is
taken for false. Raises Error naming the edge for numbers that cannot be; the graph is then unchanged.)")
      .def("chordal_cost", &chordal_cost, R"(chordal_cost(self)
--

Cost as certified solvers define it (Rosen et al. 2019, eq. 12).)")
      .def_static("read", &read_g2o, py::arg("file"), R"(read(file)
--

Reads a .g2o file (VERTEX_SE3:QUAT, EDGE_SE3:QUAT). Raises Error with file and line.)")
      .def(
          "write", [](const PoseGraph& g, const std::filesystem::path& file) { write_g2o(file, g); }, py::arg("file"),
          R"(write(self, file)
--

Writes a .g2o file, whole or not at all.)")
      .def("__repr__", [](const PoseGraph& g) {
        return "PoseGraph of " + std::to_string(g.world_from_node.size()) + " nodes, " +
               std::to_string(g.edges.size()) + " edges";
      });
}

}  // namespace cairn::python
