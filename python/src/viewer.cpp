// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/viewer.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mapper.hpp"
#include "module.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxPort = 65535;
constexpr const char* kClosed = "the viewer is closed";

ViewerAddress address_of(int port, const std::string& host, const std::optional<fs::path>& certificates) {
  if (port < 0 || port > kMaxPort)
    throw py::value_error("port is " + std::to_string(port) + "; 0 to 65535 is expected, 0 for any free port");
  return {.port = port, .host = host, .certificates = certificates.value_or(fs::path{})};
}

/// Live viewer, serialized with the calls to its mapper. Locks first its own guard, then the mapper's.
class GuardedLiveViewer {
 public:
  GuardedLiveViewer(std::shared_ptr<GuardedMapper> mapper, const std::optional<Options>& options,
                    const ViewerAddress& at)
      : mapper_(std::move(mapper)),
        viewer_(mapper_->guard->run([&] {
          auto viewer = std::make_unique<LiveViewer>(at);
          viewer->begin(mapper_->mapper, mapper_->mapper.rig(), options.value_or(mapper_->options));
          return viewer;
        })),
        site_(viewer_->site()) {}
  ~GuardedLiveViewer() {
    mapper_->guard->run_in_destructor([&] { viewer_.reset(); });
  }
  GuardedLiveViewer(const GuardedLiveViewer&) = delete;
  GuardedLiveViewer& operator=(const GuardedLiveViewer&) = delete;

  [[nodiscard]] const ViewerSite& site() const { return site_; }

  /// Runs `work` with the viewer and its mapper. Throws ValueError if the viewer is closed.
  template <class Work>
  auto run(Work&& work) {
    mapper_->guard->expect_no_callback();  // before waiting: another thread may hold the viewer and wait for the mapper
    return guard_.run([&] {
      return mapper_->guard->run_released([&] {
        if (!viewer_) throw py::value_error(kClosed);
        return work(*viewer_, mapper_->mapper);
      });
    });
  }

  /// Starts the map of another mapper, or the same map again.
  void begin(const std::shared_ptr<GuardedMapper>& mapper, const std::optional<Options>& options, int frames_before) {
    mapper->guard->expect_no_callback();
    const auto start = [&](LiveViewer& viewer) {
      viewer.begin(mapper->mapper, mapper->mapper.rig(), options.value_or(mapper->options), frames_before);
    };
    const std::shared_ptr<GuardedMapper> previous = mapper_;  // outlives its use by the viewer
    run([&](LiveViewer& viewer, const Mapper&) {
      if (mapper->guard == mapper_->guard)
        start(viewer);
      else
        mapper->guard->run_released([&] { start(viewer); });
      const py::gil_scoped_acquire acquire;  // run() reads the mapper with the interpreter's lock
      mapper_ = mapper;
    });
  }

  void close() {
    mapper_->guard->expect_no_callback();
    guard_.run([&] { mapper_->guard->run_released([&] { viewer_.reset(); }); });
  }

 private:
  std::shared_ptr<GuardedMapper> mapper_;
  std::unique_ptr<LiveViewer> viewer_;
  ViewerSite site_;
  Guard guard_;
};

/// Adds a frame with its report to the page, if any, and updates the page.
void update(GuardedLiveViewer& viewer, const std::shared_ptr<SizedFrame>& frame, const FrameReport* report,
            std::optional<double> latency_ms, bool paused, int dropped) {
  if ((frame == nullptr) != (report == nullptr))
    throw py::type_error("update takes a frame with its report, or neither");
  viewer.run([&](LiveViewer& v, const Mapper& mapper) {
    if (frame != nullptr) {
      if (!frame->frame.problem) expect_images_of(mapper.rig(), *frame);
      double stages_ms = 0;
      for (const auto& [stage, ms] : report->stage_ms) stages_ms += ms;
      v.fused(frame->frame, *report, latency_ms.value_or(stages_ms));
    }
    v.update(paused, dropped);
  });
  check_signals();
}

/// Viewer of a finished map, until it is closed.
class ClosableMapViewer {
 public:
  ClosableMapViewer(const fs::path& map, const ViewerAddress& at) {
    const py::gil_scoped_release release;
    viewer_ = std::make_unique<MapViewer>(map, at);
    site_ = viewer_->site();
  }
  ~ClosableMapViewer() { close(); }
  ClosableMapViewer(const ClosableMapViewer&) = delete;
  ClosableMapViewer& operator=(const ClosableMapViewer&) = delete;

  [[nodiscard]] const ViewerSite& site() const { return site_; }
  [[nodiscard]] bool is_opened() const {
    if (!viewer_) throw py::value_error(kClosed);
    return viewer_->is_opened();
  }
  void close() {
    std::unique_ptr<MapViewer> closed = std::move(viewer_);
    const py::gil_scoped_release release;
    closed.reset();
  }

 private:
  std::unique_ptr<MapViewer> viewer_;
  ViewerSite site_;
};

/// Members of both viewers.
template <class Viewer>
void add_site(py::class_<Viewer>& viewer, const char* name) {
  viewer
      .def_property_readonly(
          "url", [](const Viewer& v) { return v.site().urls.front().url; }, "Address of the page, with its token.")
      .def_property_readonly(
          "urls",
          [](const Viewer& v) {
            std::vector<std::string> urls;
            for (const ViewerSite::Url& url : v.site().urls) urls.push_back(url.url);
            return urls;
          },
          "Addresses of the page, most likely first: one per network of this machine.")
      .def_property_readonly(
          "fingerprint", [](const Viewer& v) { return v.site().fingerprint; },
          "SHA-256 of the certificate, in the format of browsers; empty: HTTP.")
      .def(
          "close", [](Viewer& v) { v.close(); }, R"(close(self)
--

Ends the server. Pages in browsers stay as they are.)")
      .def("__enter__", [](const py::object& self) { return self; })
      .def("__exit__", [](Viewer& v, const py::args&) { v.close(); })
      .def("__repr__", [name](const Viewer& v) {
        return repr(name, {{"url", v.site().urls.front().url}});
      });
}

void add_state(py::module_& m) {
  py::class_<LiveViewer::ViewerCommands>(m, "ViewerCommands", "Commands from browsers: result of LiveViewer.commands.")
      .def_readonly("pause", &LiveViewer::ViewerCommands::pause, "True: pause; False: continue; None: no command.")
      .def_readonly("reset", &LiveViewer::ViewerCommands::reset, "Start a new map: LiveViewer.begin.")
      .def_readonly("finish", &LiveViewer::ViewerCommands::finish, "End the run.")
      .def("__repr__", [](const LiveViewer::ViewerCommands& c) {
        return repr("ViewerCommands", {{"pause", c.pause}, {"reset", c.reset}, {"finish", c.finish}});
      });
  py::class_<LiveViewer::ViewerStats>(m, "ViewerStats", "Statistics of a LiveViewer.")
      .def_readonly("parts", &LiveViewer::ViewerStats::parts, "Number of surface blocks sent.")
      .def_readonly("updates_per_second", &LiveViewer::ViewerStats::updates_per_second, "Surface updates.")
      .def_readonly("ms_per_update", &LiveViewer::ViewerStats::ms_per_update, "Milliseconds, mean of a surface update.")
      .def_readonly("first_mesh_seconds", &LiveViewer::ViewerStats::first_mesh_seconds,
                    "From the first frame to the first surface block; None before.")
      .def("__repr__", [](const LiveViewer::ViewerStats& s) {
        return repr("ViewerStats", {{"parts", s.parts}, {"ms_per_update", s.ms_per_update}});
      });
}

/// Call of a member function without arguments.
template <class Member>
auto call_of(Member member) {
  return [member](GuardedLiveViewer& v) {
    return v.run([member](LiveViewer& viewer, const Mapper&) { return (viewer.*member)(); });
  };
}

void add_live_viewer(py::module_& m) {
  py::class_<GuardedLiveViewer> live(m, "LiveViewer",
                                     R"(LiveViewer(mapper, options=None, *, port=4242, host='', certificates=None)
--

Serves the live page of a growing map to browsers. Calls to the viewer and to its mapper wait for each other; the
server has its own thread. Keeps the mapper alive.

    with cairn.LiveViewer(mapper, port=0) as viewer:
        print(viewer.url)
        for frame in source:
            viewer.update(frame, mapper.add(frame))

options: depth range of the page's images and advice; default: the mapper's. port: 0 chooses any free port. host: an
IP address of this machine, to serve devices of that network over HTTPS; '0.0.0.0': all networks; '': only this
machine. certificates: folder of the certificate; default: the user's state folder. Raises Error if the port is in use
or the address is not local.)");
  live.def(py::init([](std::shared_ptr<GuardedMapper> mapper, const std::optional<Options>& options, int port,
                       const std::string& host, const std::optional<fs::path>& certificates) {
             return std::make_unique<GuardedLiveViewer>(std::move(mapper), options,
                                                        address_of(port, host, certificates));
           }),
           py::arg("mapper").none(false), py::arg("options") = std::nullopt, py::kw_only(),
           py::arg("port") = kDefaultViewerPort, py::arg("host") = "", py::arg("certificates") = std::nullopt,
           R"(__init__(self, mapper, options=None, *, port=4242, host='', certificates=None)
--

)")
      .def("update", &update, py::arg("frame") = py::none(), py::arg("report") = py::none(), py::kw_only(),
           py::arg("latency_ms") = std::nullopt, py::arg("paused") = false, py::arg("dropped") = 0,
           R"(update(self, frame=None, report=None, *, latency_ms=None, paused=False, dropped=0)
--

Updates the page within the available time: surface, path, images and state. Call it after each frame, and without a
frame while none arrives.

frame, report: the last Frame and its FrameReport from Mapper.add. latency_ms: milliseconds from the arrival of the
frame to its pose; default: the time of all stages of the report. paused: shown on the page. dropped: number of frames
skipped so far to keep up.)")
      .def("commands", call_of(&LiveViewer::commands),
           R"(commands(self)
--

Commands from browsers since the last call, as ViewerCommands.)")
      .def("begin", &GuardedLiveViewer::begin, py::arg("mapper").none(false), py::arg("options") = std::nullopt,
           py::kw_only(), py::arg("frames_before") = 0, R"(begin(self, mapper, options=None, *, frames_before=0)
--

Starts a new map on the page, for example after a reset. frames_before: number of frames of earlier runs, kept by a
reset; shown before a reset.)")
      .def("finishing", call_of(&LiveViewer::finishing),
           R"(finishing(self)
--

Shows on the page that the map is being corrected and written. Call it after the last frame.)")
      .def(
          "finished",
          [](GuardedLiveViewer& v, const fs::path& folder) {
            v.run([&](LiveViewer& viewer, const Mapper&) { viewer.finished(folder); });
          },
          py::arg("folder"), R"(finished(self, folder)
--

Switches browsers to the map in a folder made by `cairn reconstruct`, `live` or `merge`. Raises Error if the folder
has no map.)")
      .def_property_readonly("viewers", call_of(&LiveViewer::viewers), "Number of connected browsers.")
      .def_property_readonly("is_opened", call_of(&LiveViewer::is_opened), "True if a browser has loaded the page.")
      .def("stats", call_of(&LiveViewer::stats),
           R"(stats(self)
--

Statistics so far, as ViewerStats.)");
  add_site(live, "LiveViewer");
}

void add_map_viewer(py::module_& m) {
  py::class_<ClosableMapViewer> viewer(m, "MapViewer", R"(MapViewer(map, *, port=4242, host='', certificates=None)
--

Serves a finished map to browsers until it is closed. The server has its own thread.

map: a folder made by `cairn reconstruct`, `live` or `merge`, a tiled project, or a single file: .glb, .gltf, .ply,
.vdb or a tileset.json. port, host, certificates: as for LiveViewer. Raises Error with the cause and the remedy if the
map cannot be read, the port is in use, or the address is not local.)");
  viewer
      .def(py::init(
               [](const fs::path& map, int port, const std::string& host, const std::optional<fs::path>& certificates) {
                 return std::make_unique<ClosableMapViewer>(map, address_of(port, host, certificates));
               }),
           py::arg("map"), py::kw_only(), py::arg("port") = kDefaultViewerPort, py::arg("host") = "",
           py::arg("certificates") = std::nullopt,
           R"(__init__(self, map, *, port=4242, host='', certificates=None)
--

)")
      .def_property_readonly("is_opened", &ClosableMapViewer::is_opened, "True if a browser has loaded the page.");
  add_site(viewer, "MapViewer");
}

}  // namespace

void add_viewers(py::module_& m) {
  add_state(m);
  add_live_viewer(m);
  add_map_viewer(m);
}

}  // namespace cairn::python
