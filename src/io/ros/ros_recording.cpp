// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros/ros_recording.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "base/file_name.hpp"
#include "base/read_whole.hpp"
#include "base/words.hpp"
#include "cairn/io/source.hpp"
#include "io/datasets/zip_recording.hpp"
#include "io/recording_segment.hpp"
#include "options/yaml_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxOpenFiles = 8;  // files merged at a time
constexpr int kMaxTries = 16;             // damaged parts skipped in search of a file's first message

/// Time of the first message, seconds; empty if none is readable.
std::optional<double> start_time(RosRecording& file) {
  std::optional<double> begin;
  for (int i = 0; i < kMaxTries; ++i) {
    try {
      if (const auto message = file.next()) begin = message->received;
      break;
    } catch (const std::runtime_error&) {
      // Thrown again when the file is played.
    }
  }
  file.rewind();
  return begin;
}

/// Files of a rosbag2 folder, in time order.
class Rosbag2Folder final : public RosRecording {
 public:
  Rosbag2Folder(const fs::path& folder, std::vector<std::unique_ptr<RosRecording>> files)
      : RosRecording(folder.string(), "rosbag2 folder"), files_(std::move(files)), numbers_(files_.size()) {
    for (std::size_t i = 0; i < files_.size(); ++i) {
      add_topics(i);
      for (std::size_t t = 0; t < files_[i]->topics().size(); ++t)
        if (const auto& messages = files_[i]->topics()[t].messages) count(numbers_[i][t], *messages);
      // A file of unknown time stays after the previous file.
      const double before = i > 0 ? starts_.back().first : 0;
      starts_.emplace_back(start_time(*files_[i]).value_or(before), i);
    }
    std::sort(starts_.begin(), starts_.end());
  }

  std::optional<RosMessage> next() override {
    for (;;) {
      for (OpenFile& open_file : open_files_)
        if (!open_file.message) read_next(open_file);
      std::erase_if(open_files_, [](const OpenFile& p) { return !p.message; });
      const auto first =
          std::min_element(open_files_.begin(), open_files_.end(), [](const OpenFile& a, const OpenFile& b) {
            return std::pair(a.message->received, a.file) < std::pair(b.message->received, b.file);
          });
      if (!is_due(first)) {
        open_files_.push_back({.file = starts_[opened_++].second, .message = {}});
        continue;
      }
      if (first == open_files_.end()) return std::nullopt;
      return std::exchange(first->message, std::nullopt);
    }
  }
  void rewind() override {
    for (const auto& file : files_) file->rewind();
    open_files_.clear();
    opened_ = 0;
    ended_early_.reset();
  }

 private:
  struct OpenFile {
    std::size_t file;
    std::optional<RosMessage> message;  // next message
  };

  /// True if no unopened file starts before `first`, the earliest message of the open files.
  [[nodiscard]] bool is_due(std::vector<OpenFile>::const_iterator first) {
    if (opened_ == starts_.size()) return true;
    if (first == open_files_.end()) return false;
    if (std::pair(first->message->received, first->file) < starts_[opened_]) return true;
    if (open_files_.size() < kMaxOpenFiles) return false;
    if (!std::exchange(has_warned_, true))
      spdlog::warn(
          "{}: more than {} of its files overlap in time: messages are read out of order, and late frames are skipped; "
          "write one file in time order with `ros2 bag convert`",
          name(), kMaxOpenFiles);
    return true;
  }

  void read_next(OpenFile& open_file) {
    RosRecording& file = *files_[open_file.file];
    open_file.message = file.next();
    if (open_file.message) {
      add_topics(open_file.file);
      open_file.message->topic = numbers_[open_file.file][open_file.message->topic];
    } else if (!ended_early_) {
      ended_early_ = file.ended_early();
    }
  }

  /// Registers new topics of a file.
  void add_topics(std::size_t file) {
    const auto& topics = files_[file]->topics();
    for (auto& numbers = numbers_[file]; numbers.size() < topics.size();) {
      const RosTopic& topic = topics[numbers.size()];
      numbers.push_back(topic_of(topic.name, topic.type, topic.encoding));
    }
  }

  std::vector<std::unique_ptr<RosRecording>> files_;
  std::vector<std::vector<std::size_t>> numbers_;       // topic number by file and its topic
  std::vector<std::pair<double, std::size_t>> starts_;  // start time in seconds, and file; in time order
  std::vector<OpenFile> open_files_;
  std::size_t opened_ = 0;  // number of opened entries of starts_
  bool has_warned_ = false;
};

}  // namespace

std::size_t RosRecording::topic_of(std::string name, std::string type, RosEncoding encoding) {
  // ROS allows a subset of printable ASCII in names; other characters would garble messages.
  for (char& c : name)
    if (c < ' ' || c > '~' || c == '\'' || c == '`') c = '?';
  if (const std::size_t at = type.find("/msg/"); at != type.npos) type.erase(at, 4);
  const auto [it, is_new] = by_name_.try_emplace(name, topics_.size());
  if (is_new) topics_.push_back({.name = name, .type = std::move(type), .encoding = encoding, .messages = {}});
  return it->second;
}

void RosRecording::count(std::size_t topic, std::uint64_t messages) {
  topics_[topic].messages = topics_[topic].messages.value_or(0) + messages;
}

std::unique_ptr<RosRecording> open_rosbag2_folder(const fs::path& folder) {
  const fs::path metadata = folder / "metadata.yaml";
  std::vector<std::string> names;
  std::string compression;
  try {
    const YAML::Node all = read_yaml_file(metadata);
    const YAML::Node information = all["rosbag2_bagfile_information"];
    if (!information.IsMap()) throw std::runtime_error("has no `rosbag2_bagfile_information`");
    if (!information["relative_file_paths"].IsSequence()) throw std::runtime_error("has no `relative_file_paths`");
    for (const auto& name : information["relative_file_paths"]) names.push_back(name.as<std::string>());
    if (const auto mode = information["compression_mode"]; mode && mode.IsScalar())
      compression = mode.as<std::string>();
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(fmt::format("{}: line {}: {}", metadata.string(), error.mark.line + 1, shown(error.msg)));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(
        fmt::format("{}: {}; `ros2 bag reindex` writes it again", metadata.string(), error.what()));
  }
  if (names.empty()) throw std::runtime_error(metadata.string() + ": lists no files of the recording");
  std::vector<std::unique_ptr<RosRecording>> files;
  for (const std::string& name : names) {
    // Older versions wrote paths with the folder name.
    fs::path file = folder / name;
    std::error_code ignored;
    if (!fs::exists(file, ignored)) file = folder / fs::path(name).filename();
    if (const std::string extension = extension_of(file);
        compression == "FILE" || extension == ".zstd" || extension == ".zst")
      throw std::runtime_error(
          fmt::format("{}: is compressed as a file; decompress it with `zstd -d`, remove .zstd from its name and "
                      "`compression_mode: FILE` from {}",
                      file.string(), metadata.string()));
    if (fs::is_directory(file, ignored))
      throw std::runtime_error(
          fmt::format("{}: lists the folder {} as a file of the recording; `ros2 bag reindex` "
                      "writes it again",
                      metadata.string(), shown(name)));
    files.push_back(open_ros_recording(file));
  }
  return std::make_unique<Rosbag2Folder>(folder, std::move(files));
}

std::unique_ptr<RosRecording> open_ros_recording(const fs::path& name) {
  if (name.native().starts_with(kRos2)) return open_ros2(name.native());
  std::error_code ignored;
  if (fs::is_directory(name, ignored)) return open_rosbag2_folder(name);
  const std::string extension = extension_of(name);
  if (extension == ".mcap") return open_mcap(name);
  if (extension == ".db3") return open_rosbag2_db3(name);
  return open_ros1_bag(name);
}

bool is_ros_recording(const std::string& name) {
  if (name.starts_with(kRos2)) return true;
  if (const auto segment = read_segment(name)) return is_ros_recording(segment->recording);
  if (is_zip(name)) return is_ros_recording(unpacked(name)->recording());
  std::error_code ignored;
  if (!fs::is_directory(name, ignored)) {
    const std::string extension = extension_of(name);
    return extension == ".bag" || extension == ".mcap" || extension == ".db3";
  }
  // Other programs use this file name too.
  const fs::path metadata = fs::path(name) / "metadata.yaml";
  if (!fs::is_regular_file(metadata, ignored)) return false;
  const auto bytes = read_whole(metadata);
  return std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size())
             .find("rosbag2_bagfile_information") != std::string_view::npos;
}

}  // namespace cairn
