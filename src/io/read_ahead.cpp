// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include "cairn/io/source.hpp"

namespace cairn {
namespace {

class ReadAhead final : public WrappedSource {
 public:
  ReadAhead(std::unique_ptr<Source> source, int ahead)
      : WrappedSource(std::move(source)),
        ahead_(static_cast<std::size_t>(ahead)),
        thread_([this](const std::stop_token& s) { run(s); }) {}

  std::optional<Frame> next() override {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !frames_.empty() || ended_; });
    if (!frames_.empty()) {
      Frame frame = std::move(frames_.front());
      frames_.pop_front();
      changed_.notify_all();
      return frame;
    }
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
    return std::nullopt;
  }

 private:
  void run(const std::stop_token& stop) {
    try {
      while (auto frame = source_->next()) {
        std::unique_lock lock(mutex_);
        if (!changed_.wait(lock, stop, [&] { return frames_.size() < ahead_; })) return;
        frames_.push_back(std::move(*frame));
        changed_.notify_all();
      }
    } catch (...) {
      const std::lock_guard lock(mutex_);
      error_ = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    ended_ = true;
    changed_.notify_all();
  }

  std::size_t ahead_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Frame> frames_;
  std::exception_ptr error_;
  bool ended_ = false;
  std::jthread thread_;  // declared last, because the thread uses the other members
};

}  // namespace

std::unique_ptr<Source> read_ahead(std::unique_ptr<Source> source, int ahead) {
  return std::make_unique<ReadAhead>(std::move(source), ahead);
}

}  // namespace cairn
