// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>

#include "cairn/mapping/pose_graph.hpp"
#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

std::size_t expect_node(const PoseGraph& graph, std::size_t node) {
  if (node < graph.world_from_node.size()) return node;
  throw py::index_error("node " + std::to_string(node) + " does not exist; the graph has " +
                        std::to_string(graph.world_from_node.size()) + " nodes");
}

void add_parts(py::module_& m) {
  using Edge = PoseGraph::Edge;
  py::class_<Edge>(m, "Edge", "Measured relative pose of two nodes.")
      .def_readonly("i", &Edge::i, "Node.")
      .def_readonly("j", &Edge::j, "Node.")
      .def_property_readonly(
          "i_from_j", [](const Edge& e) { return to_numpy(e.i_from_j); },
          "(4, 4) float64: measured pose of j in the frame of i.")
      .def_property_readonly(
          "information", [](const Edge& e) { return to_numpy(e.information); },
          "(6, 6) float64 of (rotation, translation) in the frame of j, 1/rad^2 and 1/m^2.")
      .def_readonly("is_loop", &Edge::is_loop_closure, "Loop closure candidate, which may be false.")
      .def("__repr__", [](const Edge& e) {
        return repr("Edge", {{"i", e.i}, {"j", e.j}, {"is_loop", e.is_loop_closure}});
      });
  py::class_<OptimizeReport>(m, "OptimizeReport", "Result of PoseGraph.optimize.")
      .def_readonly("cost_before", &OptimizeReport::cost_before, "Half the sum of squared normalized errors.")
      .def_readonly("cost", &OptimizeReport::cost, "The same after the optimization.")
      .def_readonly("iterations", &OptimizeReport::iterations)
      .def_readonly("components", &OptimizeReport::components,
                    "Number of components without connecting edges; the first node of each is fixed.")
      .def_readonly("from_chordal", &OptimizeReport::from_chordal,
                    "True if it started from the chordal initialization.")
      .def_property_readonly(
          "edge_weights",
          [](const OptimizeReport& r) {
            return Doubles(static_cast<py::ssize_t>(r.edge_weights.size()), r.edge_weights.data());
          },
          "(edges,) float64; 1: inlier, 0: outlier.")
      .def_readonly("seconds", &OptimizeReport::seconds)
      .def("__repr__", [](const OptimizeReport& r) {
        return repr("OptimizeReport", {{"cost_before", r.cost_before}, {"cost", r.cost}, {"iterations", r.iterations}});
      });
}

}  // namespace

void add_graph(py::module_& m) {
  add_parts(m);
  py::class_<PoseGraph>(m, "PoseGraph", R"(PoseGraph()
--

Poses connected by measured relative poses.)")
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

Adds a node with an initial pose, (4, 4), world_from_node. Returns its index.)")
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
translation) in the frame of j, 1/rad^2 and 1/m^2; default: identity. is_loop: loop closure candidate, which robust
optimization may reject.)")
      .def(
          "add_gravity",
          [](PoseGraph& g, std::size_t node, const py::object& up, double sigma) {
            g.gravity.push_back({expect_node(g, node), vector_of(up, "up").normalized(), sigma});
          },
          py::arg("node"), py::arg("up"), py::arg("sigma") = PoseGraph::Gravity{}.sigma,
          R"(add_gravity(self, node, up, sigma=0.02)
--

Adds an accelerometer reading at rest. up: (3,), up direction in the node's frame; -y in the world. sigma: radians.)")
      .def_property_readonly(
          "poses", [](const PoseGraph& g) { return to_numpy(g.world_from_node); },
          "(N, 4, 4) float64, world_from_node: a copy.")
      .def(
          "set_pose",
          [](PoseGraph& g, std::size_t node, const py::object& pose) {
            g.world_from_node[expect_node(g, node)] = pose_of(pose, "pose");
          },
          py::arg("node"), py::arg("pose"), R"(set_pose(self, node, pose)
--

Sets the pose of a node, (4, 4), world_from_node.)")
      .def_property_readonly(
          "edges", [](const PoseGraph& g) { return g.edges; }, "A list of Edge: a copy.")
      .def(
          "optimize",
          [](PoseGraph& g, bool robust, double inlier_threshold, int max_iterations) {
            PoseGraph moved = g;  // other threads may add nodes meanwhile
            OptimizeReport report;
            {
              const py::gil_scoped_release release;
              report = optimize(
                  moved, {.robust = robust, .inlier_threshold = inlier_threshold, .max_iterations = max_iterations});
            }
            std::copy(moved.world_from_node.begin(), moved.world_from_node.end(), g.world_from_node.begin());
            return report;
          },
          py::kw_only(), py::arg("robust") = OptimizeOptions{}.robust,
          py::arg("inlier_threshold") = OptimizeOptions{}.inlier_threshold,
          py::arg("max_iterations") = OptimizeOptions{}.max_iterations,
          R"(optimize(self, *, robust=True, inlier_threshold=22.46, max_iterations=100)
--

Minimizes the sum of squared errors of all edges (Levenberg-Marquardt on SE(3)). robust: weights loop closure
candidates by graduated non-convexity. inlier_threshold: squared normalized error of an outlier. Raises Error with the
edge for invalid values; the graph then stays unchanged.)")
      .def("chordal_cost", &chordal_cost, R"(chordal_cost(self)
--

Cost as defined by certified solvers (Rosen et al. 2019, eq. 12).)")
      .def_static("read", &read_g2o, py::arg("file"), R"(read(file)
--

Reads a .g2o file (VERTEX_SE3:QUAT, EDGE_SE3:QUAT). Raises Error with file and line.)")
      .def(
          "write", [](const PoseGraph& g, const std::filesystem::path& file) { write_g2o(file, g); }, py::arg("file"),
          R"(write(self, file)
--

Writes a .g2o file, atomically.)")
      .def("__repr__", [](const PoseGraph& g) {
        return "PoseGraph of " + std::to_string(g.world_from_node.size()) + " nodes, " +
               std::to_string(g.edges.size()) + " edges";
      });
}

}  // namespace cairn::python
