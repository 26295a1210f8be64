// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <memory>
#include <string>
#include <utility>

#include "cairn/frame.hpp"

namespace cairn {

/// A source that changes how or when the frames of another one are given.
class WrappedSource : public Source {
 public:
  explicit WrappedSource(std::unique_ptr<Source> source) : source_(std::move(source)) {}
  const Camera& camera() const override { return source_->camera(); }
  std::optional<int> size() const override { return source_->size(); }
  std::string ended_early() const override { return source_->ended_early(); }
  int dropped() const override { return source_->dropped(); }

 protected:
  std::unique_ptr<Source> source_;
};

}  // namespace cairn
