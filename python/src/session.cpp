// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/session.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "cairn/building/merge.hpp"
#include "mapper.hpp"
#include "module.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

namespace fs = std::filesystem;

template <class Make>
std::shared_ptr<GuardedSession> session_of(const Make& make) {
  const py::gil_scoped_release release;
  return std::make_shared<GuardedSession>(GuardedSession{make()});
}

std::shared_ptr<GuardedMapper> mapper_of(const std::shared_ptr<GuardedSession>& s, const std::optional<Rig>& rig,
                                         const std::optional<Options>& options, std::optional<float> voxel_size,
                                         int device) {
  if (!rig && (options || voxel_size))
    throw py::type_error("options require a rig: without a rig the session's own camera and options are used");
  Mapper mapper = s->guard->run([&] {
    return rig ? s->session.mapper(*rig, options_of(*rig, options, voxel_size), device) : s->session.mapper(device);
  });
  const Options used = options_of(mapper.rig(), options, voxel_size);
  return std::make_shared<GuardedMapper>(GuardedMapper{s, std::move(mapper), s->guard, used});
}

}  // namespace

void add_session(py::module_& m) {
  py::class_<Session::Info>(m, "SessionInfo", "Settings of a session.")
      .def_readonly("rig", &Session::Info::rig)
      .def_readonly("voxel_size", &Session::Info::voxel_size, "Meters.")
      .def_readonly("truncation", &Session::Info::truncation, "Meters.")
      .def_readonly("min_depth", &Session::Info::min_depth, "Meters.")
      .def_readonly("max_depth", &Session::Info::max_depth, "Meters.")
      .def_readonly("note", &Session::Info::note, "Note given to checkpoint.");

  py::class_<GuardedSession, std::shared_ptr<GuardedSession>>(
      m, "Session",
      R"(Saved state of a map in a folder, from which a run continues after its program has ended or was killed.

    session = cairn.Session.create("desk/session")
    mapper = session.mapper(rig)
    for frame in source:
        mapper.add(frame)
    session.checkpoint(mapper)

One process at a time writes to a session.)")
      .def_static(
          "create", [](const fs::path& folder) { return session_of([&] { return Session::create(folder); }); },
          py::arg("folder"), R"(create(folder)
--

Creates a session. An existing session remains until the first checkpoint of the new one. Raises Error if another
process writes there.)")
      .def_static(
          "resume", [](const fs::path& folder) { return session_of([&] { return Session::resume(folder); }); },
          py::arg("folder"), R"(resume(folder)
--

Opens the session in a folder to continue it. Raises Error for a missing, damaged or locked session.)")
      .def_static(
          "copy",
          [](const fs::path& from, const fs::path& to) { return session_of([&] { return Session::copy(from, to); }); },
          py::arg("source"), py::arg("folder"), R"(copy(source, folder)
--

Copies a session to another folder and continues the copy, which is valid after its first checkpoint.)")
      .def_static(
          "info",
          [](const fs::path& folder) {
            const py::gil_scoped_release release;
            return Session::info(folder);
          },
          py::arg("folder"), R"(info(folder)
--

Settings from the last checkpoint, as SessionInfo. Raises Error for a missing or damaged session.)")
      .def("mapper", &mapper_of, py::arg("rig") = std::nullopt, py::arg("options") = std::nullopt, py::kw_only(),
           py::arg("voxel_size") = std::nullopt, py::arg("device") = -1,
           R"(mapper(self, rig=None, options=None, *, voxel_size=None, device=-1)
--

Creates the Mapper that stores its keyframes and submaps in this session; call once. The mapper is new, or restored
exactly from the last checkpoint. Default of rig and options: those of the checkpoint. Raises Error if the session has
another camera or voxel size.)")
      .def(
          "checkpoint",
          [](GuardedSession& s, const GuardedMapper& mapper, const std::string& note) {
            if (mapper.guard != s.guard) throw py::value_error("the mapper was not created by this session");
            s.guard->run([&] { s.session.checkpoint(mapper.mapper, note); });
          },
          py::arg("mapper"), py::arg("note") = "", R"(checkpoint(self, mapper, note='')
--

Starts writing a checkpoint with all state needed to continue, while further frames are added. note: returned by info.
A kill at any moment leaves the last complete checkpoint.)")
      .def(
          "problem", [](GuardedSession& s) { return s.guard->run([&] { return s.session.problem(); }); },
          R"(problem(self)
--

Waits for the checkpoint in progress. Returns the reason if session files cannot be written, or None.)");
  py::class_<MergedSession>(m, "MergedSession", "Connection of a session to the earlier ones of a merge.")
      .def_readonly("compared", &MergedSession::compared, "Keyframes of the session.")
      .def_readonly("loops", &MergedSession::loops, "Loop closures to the earlier sessions.")
      .def_readonly("merged", &MergedSession::merged, "True if consistent loop closures connect it.")
      .def("__repr__", [](const MergedSession& r) {
        return repr("MergedSession", {{"compared", r.compared}, {"loops", r.loops}, {"merged", r.merged}});
      });
  m.def(
      "merge_sessions",
      [](const std::vector<fs::path>& maps, const fs::path& to, bool allow_unmerged, int device) {
        const py::gil_scoped_release release;
        return merge_sessions(maps, to, allow_unmerged, device);
      },
      py::arg("maps"), py::arg("to"), py::arg("allow_unmerged") = false, py::arg("device") = -1,
      R"(merge_sessions(maps, to, allow_unmerged=False, device=-1)
--

Merges the sessions in the folders `maps` into a session in `to`: aligns them by loop closures and optimizes all
keyframe poses jointly. The input sessions stay unchanged. Returns one MergedSession per map. Raises Error if cameras
or voxel sizes differ, and, without `allow_unmerged`, for a map without consistent loop closures to the others.)");
}

}  // namespace cairn::python
