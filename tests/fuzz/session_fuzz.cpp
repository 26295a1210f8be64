// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// State of a session. The checksum is corrected, else no other check would be reached.
#include <fmt/format.h>

#include <boost/crc.hpp>

#include "fuzz.hpp"
#include "session/session_files.hpp"
#include "volume/vdb/brick_file.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool prepared = [] {
    std::filesystem::create_directory(fuzz::folder() / "run-0001");
    write_bricks(fuzz::folder() / "run-0001" / "active-000001.vdb", BrickTree());
    return true;
  }();
  (void)prepared;
  const std::string_view all = fuzz::text_of(data, size);
  const std::string_view header = all.substr(0, all.find('\n'));
  const std::string_view state = all.substr(std::min(all.size(), header.size() + 1));
  boost::crc_32_type crc;
  crc.process_bytes(state.data(), state.size());
  fuzz::file_of("state.cbor", fmt::format("{} {:08x}\n{}", header.substr(0, header.rfind(' ')), crc.checksum(), state));
  fuzz::expect_value_or_plain_error([&] {
    const SessionState session = read_session(fuzz::folder()).session;
    const Atlas& atlas = session.back_end.atlas;
    if (atlas.world_from_camera.size() != atlas.keyframes.size()) std::abort();
    for (const Loop& loop : atlas.loops)
      if (loop.edge.i >= atlas.keyframes.size() || loop.edge.j >= atlas.keyframes.size()) std::abort();
    for (std::size_t i = 0; i < atlas.frames.size(); ++i)
      if (atlas.frames[i].keyframe >= atlas.keyframes.size()) std::abort();
    for (const auto& level : session.tracker.reference.levels) fuzz::touch(level);
  });
  return 0;
}
