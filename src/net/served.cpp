// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "net/served.hpp"

#include <future>
#include <optional>

#include "base/gzip.hpp"

namespace cairn {

const std::string& Text::packed() const {
  std::call_once(once_, [&] { packed_ = gzip(bytes_); });
  return packed_;
}

Make once(std::function<Content()> make, bool takes_long) {
  struct Kept {
    std::mutex mutex;
    std::optional<Content> content;
  };
  return {.make =
              [make = std::move(make), kept = std::make_shared<Kept>()] {
                const std::lock_guard lock(kept->mutex);
                if (!kept->content) kept->content = make();
                return *kept->content;
              },
          .takes_long = takes_long};
}

Make beforehand(std::function<Content()> make) {
  return {.make = [made = std::async(std::launch::async, std::move(make)).share()] { return made.get(); }};
}

}  // namespace cairn
