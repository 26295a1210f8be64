// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/session.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

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
    throw py::type_error("options need a rig: without one the session's own camera and options are taken");
  Mapper mapper = s->guard->run([&] {
    return rig ? s->session.mapper(*rig, options_of(*rig, options, voxel_size), device) : s->session.mapper(device);
  });
  return std::make_shared<GuardedMapper>(GuardedMapper{s, std::move(mapper), s->guard});
}

}  // namespace

void add_session(py::module_& m) {
  py::class_<Session::Info>(m, "SessionInfo", "What a session was made with.")
      .def_readonly("rig", &Session::Info::rig)
      .def_readonly("voxel_size", &Session::Info::voxel_size, "Metres.")
      .def_readonly("truncation", &Session::Info::truncation, "Metres.")
      .def_readonly("min_depth", &Session::Info::min_depth, "Metres.")
      .def_readonly("max_depth", &Session::Info::max_depth, "Metres.")
      .def_readonly("note", &Session::Info::note, "What checkpoint was given.");

  py::class_<GuardedSession, std::shared_ptr<GuardedSession>>(
      m, "Session", R"(A folder from which a map can be gone on with after its program has ended or was killed.

    session = cairn.Session.create("desk/session")
    mapper = session.mapper(rig)
    for frame in source:
        mapper.add(frame)
    session.checkpoint(mapper)

One process at a time writes into a session.)")
      .def_static(
          "create", [](const fs::path& folder) { return session_of([&] { return Session::create(folder); }); },
          py::arg("folder"), R"(create(folder)
--

Begins a session. One that is there stays until this one's first checkpoint. Raises Error while somebody else writes
there.)")
      .def_static(
          "resume", [](const fs::path& folder) { return session_of([&] { return Session::resume(folder); }); },
          py::arg("folder"), R"(resume(folder)
--

The session in a folder, to go on with. Raises Error if there is none, it is damaged, or somebody else writes there.)")
      .def_static(
          "copy",
          [](const fs::path& from, const fs::path& to) { return session_of([&] { return Session::copy(from, to); }); },
          py::arg("source"), py::arg("folder"), R"(copy(source, folder)
--

The session in a folder, to go on with in another one: a copy, which counts from its first checkpoint.)")
      .def_static(
          "info",
          [](const fs::path& folder) {
            const py::gil_scoped_release release;
            return Session::info(folder);
          },
          py::arg("folder"), R"(info(folder)
--

What a session was made with, as SessionInfo. Raises Error if there is none or it is damaged.)")
      .def("mapper", &mapper_of, py::arg("rig") = std::nullopt, py::arg("options") = std::nullopt, py::kw_only(),
           py::arg("voxel_size") = std::nullopt, py::arg("device") = -1,
           R"(mapper(self, rig=None, options=None, *, voxel_size=None, device=-1)
--

The mapper whose keyframes and submaps lie in this session, once: a new one, or the one of the last checkpoint as if
nothing had happened. Without rig that checkpoint's camera and options are taken. Raises Error when the session was made
with another camera or voxel size.)")
      .def(
          "checkpoint",
          [](GuardedSession& s, const GuardedMapper& mapper, const std::string& note) {
            if (mapper.guard != s.guard) throw py::value_error("the mapper is not this session's");
            s.guard->run([&] { s.session.checkpoint(mapper.mapper, note); });
          },
          py::arg("mapper"), py::arg("note") = "", R"(checkpoint(self, mapper, note='')
--

Writes all that is needed to go on from here, beside the next frames. A kill at any moment leaves the last checkpoint
that was written.)")
      .def(
          "problem", [](GuardedSession& s) { return s.guard->run([&] { return s.session.problem(); }); },
          R"(problem(self)
--

Waits for the checkpoint being written. Returns why session files cannot be written, or None.)")
      .def_static(
          "merge",
          [](GuardedMapper& mapper, const fs::path& other, int device) {
            return mapper.guard->change([&] { return Session::merge(mapper.mapper, other, device); });
          },
          py::arg("mapper"), py::arg("other"), py::arg("device") = -1, R"(merge(mapper, other, device=-1)
--

Adds the map of the session in another folder to a session's mapper, by what both have seen, and tells in Merged whether
it was joined. Nothing in the other folder changes. Raises Error when cameras or voxels differ.)");
}

}  // namespace cairn::python
