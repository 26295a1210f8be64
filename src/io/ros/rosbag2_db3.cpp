// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// rosbag2 files in SQLite: the tables `topics` and `messages`; single messages may be compressed with Zstandard.
#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string_view>
#include <unordered_map>

#include "base/checked_count.hpp"
#include "base/words.hpp"
#include "io/file_bytes.hpp"
#include "io/ros/ros_compression.hpp"
#include "io/ros/ros_recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kMaxMessage = 256 << 20, kMinLimit = 1 << 20;  // bytes of a row
constexpr std::uint64_t kMinRowSize = 4;                               // minimum bytes of a row in the file
// Steps of SQLite's virtual machine allowed per file byte: a row takes 50 steps, and has 100 bytes or more.
constexpr std::uint64_t kStepsPerByte = 4, kFreeSteps = 10'000'000;
constexpr int kProgressInterval = 10'000;
constexpr std::string_view kZstd("\x28\xb5\x2f\xfd", 4);

struct Close {
  void operator()(sqlite3* database) const { sqlite3_close(database); }
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Statement = std::unique_ptr<sqlite3_stmt, Close>;

/// File URI, `immutable` without a journal, because SQLite needs write access in the folder if not.
std::string uri_of(const fs::path& file) {
  std::string uri = "file:";
  for (const char c : fs::absolute(file).string())
    uri += c == '%' || c == '?' || c == '#' ? fmt::format("%{:02x}", static_cast<int>(c)) : std::string(1, c);
  std::error_code ignored;
  return uri + (fs::exists(file.string() + "-wal", ignored) ? "?mode=ro" : "?mode=ro&immutable=1");
}

class Rosbag2Db3 final : public RosRecording {
 public:
  explicit Rosbag2Db3(const fs::path& file) : RosRecording(file.string(), "rosbag2 .db3 file") {
    check_size(file);
    sqlite3* opened = nullptr;
    const int result = sqlite3_open_v2(uri_of(file).c_str(), &opened,
                                       SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX, nullptr);
    database_.reset(opened);
    if (result != SQLITE_OK) throw std::runtime_error(name() + ": " + error_text());
    std::error_code no_journal;
    const std::uintmax_t journal = fs::file_size(file.string() + "-wal", no_journal);
    restrict_sqlite(fs::file_size(file) + (no_journal ? 0 : journal));
    require_table("topics");
    require_table("messages");
    read_topics();
    read_order();
    rewind();
  }

  void rewind() override {
    ended_early_.reset();
    rows_ = steps_ = 0;
    constexpr const char* kSelect = "SELECT id, topic_id, timestamp, data FROM messages";
    if (!order_.empty())
      messages_ = prepared(fmt::format("{} WHERE id = ?", kSelect));
    else
      messages_ = prepared(fmt::format("{} ORDER BY {}", kSelect, has_index_of_times_ ? "timestamp" : "id"));
  }

  std::optional<RosMessage> next() override {
    while (!ended_early_) {
      const int result = rows_++ > max_rows_ ? SQLITE_CORRUPT : step();
      if (result == SQLITE_DONE) {
        ended_early_ = cut_off_;
        return std::nullopt;
      }
      if (result != SQLITE_ROW) {
        ended_early_ = cut_off_.value_or(
            fmt::format("{}: cannot be read after row {}: {}; earlier messages are read; copy it again", name(), row_,
                        error_text()));
        return std::nullopt;
      }
      row_ = static_cast<std::uint64_t>(sqlite3_column_int64(messages_.get(), 0));
      const auto topic = topic_of_id_.find(sqlite3_column_int64(messages_.get(), 1));
      if (topic != topic_of_id_.end()) return message_of(topic->second);
    }
    return std::nullopt;
  }

 private:
  [[nodiscard]] std::string error_text() const {
    if (rows_ > max_rows_) return "it has more rows than fit its size";
    return steps_ > max_steps_ ? "a query takes more steps than its size allows"
                               : shown(sqlite3_errmsg(database_.get()));
  }

  /// Restricts SQLite to reading table rows: no code in the file runs, and query time is bounded by the file size.
  void restrict_sqlite(std::uint64_t size) {
    sqlite3* database = database_.get();
    for (const int option : {SQLITE_DBCONFIG_TRUSTED_SCHEMA, SQLITE_DBCONFIG_ENABLE_VIEW,
                             SQLITE_DBCONFIG_ENABLE_TRIGGER, SQLITE_DBCONFIG_ENABLE_LOAD_EXTENSION})
      sqlite3_db_config(database, option, 0, nullptr);
    // SQLite rejects truncated files unless writable_schema is set for repair, and the defensive mode forbids it.
    if (cut_off_)
      sqlite3_exec(database, "PRAGMA writable_schema = ON", nullptr, nullptr, nullptr);
    else
      sqlite3_db_config(database, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    // A row larger than the file would read some bytes repeatedly.
    sqlite3_limit(database, SQLITE_LIMIT_LENGTH,
                  static_cast<int>(std::clamp<std::uint64_t>(size, kMinLimit, kMaxMessage)));
    max_rows_ = size / kMinRowSize;
    max_steps_ = kFreeSteps + product(size, kStepsPerByte);
    sqlite3_progress_handler(
        database, kProgressInterval,
        [](void* self) {
          auto& recording = *static_cast<Rosbag2Db3*>(self);
          return (recording.steps_ += kProgressInterval) > recording.max_steps_ ? 1 : 0;
        },
        this);
  }

  /// Throws if a name is no table of stored rows: views, virtual tables and computed columns run code from the file.
  void require_table(const std::string& table) const {
    const auto invalid = [&](const std::string& what) {
      return std::runtime_error(fmt::format("{}: is not a rosbag2 file: its `{}` {}", name(), table, what));
    };
    const auto kind =
        prepared(fmt::format("SELECT type, rootpage FROM sqlite_master WHERE name = '{}' COLLATE NOCASE", table));
    if (const int result = sqlite3_step(kind.get()); result == SQLITE_DONE)
      throw std::runtime_error(
          cut_off_.value_or(fmt::format("{}: is not a rosbag2 file: no such table: {}", name(), table)));
    else if (result != SQLITE_ROW)
      throw std::runtime_error(cut_off_.value_or(fmt::format("{}: is not a rosbag2 file: {}", name(), error_text())));
    if (text(kind, 0) != "table" || sqlite3_column_int64(kind.get(), 1) <= 0) throw invalid("is not a table");
    const auto columns = prepared(fmt::format("SELECT 1 FROM pragma_table_xinfo('{}') WHERE hidden <> 0", table));
    if (sqlite3_step(columns.get()) == SQLITE_ROW) throw invalid("has computed columns");
  }

  [[nodiscard]] Statement prepared(const std::string& query) const {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(database_.get(), query.c_str(), -1, &statement, nullptr) != SQLITE_OK)
      throw std::runtime_error(cut_off_.value_or(fmt::format("{}: is not a rosbag2 file: {}", name(), error_text())));
    return Statement(statement);
  }

  /// Records a file shorter than the page count and page size (big-endian) in its header.
  void check_size(const fs::path& file) {
    FileBytes in(file);
    std::array<std::uint8_t, 100> head{};
    if (!in.read(head.data(), head.size()) ||
        std::string_view(reinterpret_cast<const char*>(head.data()), 15) != "SQLite format 3")
      throw std::runtime_error(
          fmt::format("{}: is not a SQLite file, so not a rosbag2 recording; copy it again", name()));
    const std::uint64_t page = head[16] << 8 | head[17],
                        count = static_cast<std::uint64_t>(head[28]) << 24 | head[29] << 16 | head[30] << 8 | head[31];
    const std::uint64_t expected_size = (page == 1 ? 65536 : page) * count;
    if (expected_size > in.size())
      cut_off_ = fmt::format("{}: is cut off, it has {} of its {} bytes; its readable part is used; copy it again",
                             name(), in.size(), expected_size);
  }

  static std::string text(const Statement& row, int column) {
    const auto* begin = reinterpret_cast<const char*>(sqlite3_column_text(row.get(), column));
    return begin == nullptr ? "" : begin;
  }

  void read_topics() {
    const auto topics = prepared("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
    int result = SQLITE_ROW;
    for (std::uint64_t rows = 0; (result = sqlite3_step(topics.get())) == SQLITE_ROW && rows < max_rows_; ++rows) {
      const std::string encoding = text(topics, 3);
      topic_of_id_[sqlite3_column_int64(topics.get(), 0)] = topic_of(text(topics, 1), text(topics, 2),
                                                                     encoding == "cdr"         ? RosEncoding::cdr
                                                                     : encoding == "rosmsg_v1" ? RosEncoding::ros1
                                                                                               : RosEncoding::unknown);
    }
    if (!cut_off_ && result != SQLITE_DONE)
      throw std::runtime_error(fmt::format("{}: is not a rosbag2 file: {}", name(), error_text()));
  }

  /// Counts the messages, and sorts them if the file has no index by time. Truncated files may have lost their index;
  /// their rows are read in write order.
  void read_order() {
    if (cut_off_) return;
    has_index_of_times_ = has_index_of_times();
    std::vector<std::uint64_t> counts(topics().size());
    steps_ = 0;
    const auto rows = prepared(
        fmt::format("SELECT id, timestamp, topic_id FROM messages{}", has_index_of_times_ ? "" : " ORDER BY id"));
    int result = SQLITE_ROW;
    for (std::uint64_t i = 0; i < max_rows_ && (result = sqlite3_step(rows.get())) == SQLITE_ROW; ++i) {
      if (const auto it = topic_of_id_.find(sqlite3_column_int64(rows.get(), 2)); it != topic_of_id_.end())
        ++counts[it->second];
      if (!has_index_of_times_)
        order_.emplace_back(sqlite3_column_int64(rows.get(), 1), sqlite3_column_int64(rows.get(), 0));
    }
    if (steps_ > max_steps_)
      throw std::runtime_error(fmt::format("{}: is not a rosbag2 file: {}", name(), error_text()));
    if (result != SQLITE_DONE) order_ = {};  // a damaged file is read as far as it goes
    for (std::size_t i = 0; i < counts.size(); ++i) count(i, counts[i]);
    const auto by_time = [](const auto& a, const auto& b) { return a.first < b.first; };
    if (std::is_sorted(order_.begin(), order_.end(), by_time))
      order_ = {};
    else
      std::sort(order_.begin(), order_.end());
  }

  /// Returns the next row, like sqlite3_step(). Reading rows one by one takes no more steps than reading all of them.
  int step() {
    if (order_.empty()) {
      steps_ = 0;
      return sqlite3_step(messages_.get());
    }
    for (;;) {
      if (rows_ > order_.size()) return SQLITE_DONE;
      sqlite3_reset(messages_.get());
      sqlite3_bind_int64(messages_.get(), 1, order_[rows_ - 1].second);
      const int result = sqlite3_step(messages_.get());
      if (result != SQLITE_DONE) return result;
      ++rows_;
    }
  }

  [[nodiscard]] bool has_index_of_times() const {
    const auto indices = prepared(
        "SELECT 1 FROM pragma_index_list('messages') AS list, pragma_index_info(list.name) AS info WHERE info.seqno = "
        "0 "
        "AND info.name = 'timestamp'");
    return sqlite3_step(indices.get()) == SQLITE_ROW;
  }

  RosMessage message_of(std::size_t topic) {
    const auto* begin = static_cast<const std::uint8_t*>(sqlite3_column_blob(messages_.get(), 3));
    std::span<const std::uint8_t> bytes(begin, static_cast<std::size_t>(sqlite3_column_bytes(messages_.get(), 3)));
    if (std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()).starts_with(kZstd)) {
      try {
        unpacked_ = unpacked("zstd", bytes, std::nullopt);
      } catch (const std::runtime_error& error) {
        throw std::runtime_error(fmt::format("{}: row {}: {}", name(), row_, error.what()));
      }
      bytes = unpacked_;
    }
    return {topic, 1e-9 * static_cast<double>(sqlite3_column_int64(messages_.get(), 2)), row_, bytes, &name(), "row"};
  }

  std::unique_ptr<sqlite3, Close> database_;
  Statement messages_;
  std::uint64_t row_ = 0, rows_ = 0, max_rows_ = 0;  // number of the last row; rows delivered
  std::uint64_t steps_ = 0, max_steps_ = 0;          // of SQLite's virtual machine, in one call
  std::optional<std::string> cut_off_;
  bool has_index_of_times_ = false;
  std::vector<std::pair<std::int64_t, std::int64_t>> order_;  // times and ids; empty: file order
  std::vector<std::uint8_t> unpacked_;
  std::unordered_map<std::int64_t, std::size_t> topic_of_id_;
};

}  // namespace

std::unique_ptr<RosRecording> open_rosbag2_db3(const fs::path& file) { return std::make_unique<Rosbag2Db3>(file); }

}  // namespace cairn
