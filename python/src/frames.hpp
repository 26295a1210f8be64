// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <pybind11/pybind11.h>

#include <array>
#include <memory>

#include "cairn/mapping/frame.hpp"
#include "guard.hpp"
#include "numpy.hpp"

namespace cairn::python {

/// Frame with the sizes of its images: rows, columns.
struct SizedFrame {
  Frame frame;
  std::array<py::ssize_t, 2> depth_size{}, color_size{};
};

/// Arguments of a frame from Python.
struct FrameParts {
  py::object depth, color = py::none(), time = py::none(), depth_scale = py::none(), confidence = py::none(),
                    pose = py::none(), guess = py::none(), acceleration = py::none(), gyro = py::none(),
                    accelerations = py::none();
  double color_delay = 0;
  bool held_out = false;
};
/// Fills a frame and reuses its memory. Throws ValueError, TypeError with the given and the expected value; also for
/// images that do not match `rig`, unless null.
void fill(SizedFrame& frame, const FrameParts& parts, int index, const Rig* rig);

/// Throws ValueError for images that do not match the rig.
void expect_images_of(const Rig& rig, const SizedFrame& frame);

/// Source read by Python.
struct GuardedSource {
  std::unique_ptr<Source> source;
  std::unique_ptr<Guard> guard = std::make_unique<Guard>();
  bool is_live = false;          ///< a LiveSource
  std::optional<int> size = {};  ///< frames, when opened
  [[nodiscard]] std::optional<SizedFrame> next();
};

/// Source of cairn.open, or an iterable of Frames, borrowed for the duration of a call.
class BorrowedSource {
 public:
  BorrowedSource(py::object frames, const Rig& rig);
  ~BorrowedSource();
  BorrowedSource(const BorrowedSource&) = delete;
  BorrowedSource& operator=(const BorrowedSource&) = delete;
  [[nodiscard]] Source& get() { return *source_; }
  /// Raises the exception of Python's iteration, if any.
  void rethrow() const;
  /// Runs `work` with exclusive use of the source.
  template <class Work>
  auto run(Work&& work) {
    return guard_->run(std::forward<Work>(work));
  }

 private:
  std::unique_ptr<Source> own_;
  Source* source_;
  std::unique_ptr<Guard> own_guard_;
  Guard* guard_;
};

}  // namespace cairn::python
