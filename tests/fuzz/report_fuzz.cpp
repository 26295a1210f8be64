// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// report.json of a finished map, as read for its page.
#include <spdlog/spdlog.h>

#include "fuzz.hpp"
#include "view/finished_map.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  spdlog::set_level(spdlog::level::off);
  (void)fuzz::file_of("report.json", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] {
    const FinishedMap map(fuzz::folder());
    if (map.served().empty() || map.inlined(1 << 20).first.empty()) std::abort();
  });
  return 0;
}
