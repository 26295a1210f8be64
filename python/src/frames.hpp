// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <pybind11/pybind11.h>

#include <array>
#include <memory>

#include "cairn/frame.hpp"
#include "guard.hpp"
#include "numpy.hpp"

namespace cairn::python {

/// A frame that knows the sizes of its images: rows, columns.
struct SizedFrame {
  Frame frame;
  std::array<py::ssize_t, 2> depth_size{}, colour_size{};
};

/// What a frame is made of, as Python gives it.
struct FrameParts {
  py::object depth, colour, time, depth_scale, confidence, pose, guess, acceleration, gyro;
  double colour_delay = 0;
  bool held_out = false;
};
/// Fills a frame, whose memory is used again. Throws ValueError, TypeError with what came and what is expected; of
/// images that are not `rig`'s, too, unless that is null.
void fill(SizedFrame& frame, const FrameParts& parts, int index, const Rig* rig);

/// Throws ValueError for images that are not the rig's.
void expect_images_of(const Rig& rig, const SizedFrame& frame);

/// A source that Python reads.
struct GuardedSource {
  std::unique_ptr<Source> source;
  std::unique_ptr<Guard> guard = std::make_unique<Guard>();
  bool is_live = false;          ///< a LiveSource
  std::optional<int> size = {};  ///< frames, when it was opened
  [[nodiscard]] std::optional<SizedFrame> next();
};

/// A Source of cairn.open, or of anything that gives Frames, for as long as the call that it is given to.
class BorrowedSource {
 public:
  BorrowedSource(py::object frames, const Rig& rig);
  ~BorrowedSource();
  BorrowedSource(const BorrowedSource&) = delete;
  BorrowedSource& operator=(const BorrowedSource&) = delete;
  [[nodiscard]] Source& get() { return *source_; }
  /// Raises what was raised while Python was asked for the next frame.
  void rethrow() const;
  /// Runs `work` while nobody else reads the source.
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
