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
#include <utility>

#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/export.hpp"

namespace cairn::python {

namespace py = pybind11;

/// Serializes calls to the guarded object.
class Guard {
 public:
  /// Runs `work` without the interpreter's lock, after other threads' calls. `work` must not return a Python object.
  template <class Work>
  auto run(Work&& work) {
    const py::gil_scoped_release release;
    return run_released(std::forward<Work>(work));
  }
  /// As run(), for callers that do not hold the interpreter's lock.
  template <class Work>
  auto run_released(Work&& work) {
    expect_no_callback();
    const std::lock_guard lock(mutex_);
    const Owner owner(owner_);
    return work();
  }
  /// As run(), for destructors: in a callback, `work` runs at once.
  template <class Work>
  void run_in_destructor(Work&& work) {
    const py::gil_scoped_release release;
    if (is_callback()) return work();
    const std::lock_guard lock(mutex_);
    const Owner owner(owner_);
    work();
  }
  /// Throws if this thread runs a callback of a guarded call.
  void expect_no_callback() const {
    if (is_callback())
      throw std::runtime_error("a callback cannot use the object that called it: wait until the call has returned");
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
  [[nodiscard]] bool is_callback() const { return owner_.load() == std::this_thread::get_id(); }

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
  const std::shared_ptr<py::object> callback(new py::object(std::move(progress)), [](py::object* p) {
    const py::gil_scoped_acquire acquire;
    delete p;
  });
  return [callback](int done, int count, const std::string& step) {
    const py::gil_scoped_acquire acquire;
    check_signals();
    if (!callback->is_none()) (*callback)(done, count, step);
  };
}

}  // namespace cairn::python
