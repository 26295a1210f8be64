// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Long calls release the interpreter's lock, and wait for each other if they use the same mapper.
#pragma once
#include <pybind11/pybind11.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "cairn/esdf.hpp"
#include "cairn/export.hpp"

namespace cairn::python {

namespace py = pybind11;

/// Serializes calls to the guarded object.
class Guard {
 public:
  /// Runs `work` without the interpreter's lock, after other threads' calls. `work` must not return a Python object.
  template <class Work>
  auto run(Work&& work) {
    const py::gil_scoped_release release;
    if (owner_.load() == std::this_thread::get_id())
      throw std::runtime_error("a callback cannot use what is calling it: wait until that call has returned");
    const std::lock_guard lock(mutex_);
    const Owner owner(owner_);
    return work();
  }
  /// As run(), for changes of the map.
  template <class Work>
  auto change(Work&& work) {
    return run([&] {
      ++version;
      return work();
    });
  }

  std::uint64_t version = 0;  ///< of the map
  /// Latest distance field, with its version of the map.
  std::shared_ptr<const DistanceField> distances;
  std::uint64_t distances_version = 0;

 private:
  struct Owner {
    explicit Owner(std::atomic<std::thread::id>& of) : owner(of) { owner = std::this_thread::get_id(); }
    ~Owner() { owner = std::thread::id(); }
    Owner(const Owner&) = delete;
    Owner& operator=(const Owner&) = delete;
    std::atomic<std::thread::id>& owner;
  };
  std::mutex mutex_;
  std::atomic<std::thread::id> owner_;
};

/// Throws KeyboardInterrupt, or the exception of another signal handler. Requires the interpreter's lock.
inline void check_signals() {
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

/// Calls `progress` (None or callable) with done, count and the next step, and checks for Ctrl-C between two steps.
[[nodiscard]] inline ExportProgress progress_to(py::object progress) {
  // The last copy may be destroyed without the interpreter's lock.
  const std::shared_ptr<py::object> to(new py::object(std::move(progress)), [](py::object* p) {
    const py::gil_scoped_acquire acquire;
    delete p;
  });
  return [to](int done, int count, const std::string& what) {
    const py::gil_scoped_acquire acquire;
    check_signals();
    if (!to->is_none()) (*to)(done, count, what);
  };
}

}  // namespace cairn::python
