// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros/dds.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>

#include "base/runtime_library.hpp"
#include "base/words.hpp"
#include "io/ros/dds_api.hpp"
#include "io/ros/ros2_types.hpp"

namespace cairn {
namespace {

using namespace dds;
constexpr std::string_view kTopicPrefix = "rt/";    // of ROS 2's topics
constexpr std::size_t kMaxPublications = 8192;      // read at once
constexpr std::size_t kMaxTaken = 64;               // messages taken at once
constexpr std::int64_t kMaxBlocking = 100'000'000;  // ns, default of the reliability policy
const std::array<std::string, 3> kFiles{"libddsc.so.0debian", "libddsc.so.0", "libddsc.so"};

struct Functions {
#define CAIRN_DECLARE(name) decltype(&::name) name = nullptr;  // NOLINT(bugprone-macro-parentheses): a member's name
  CAIRN_DDS(CAIRN_DECLARE)
#undef CAIRN_DECLARE
};

/// The library's log: its last error, and a warning for each topic with malformed messages.
class Log {
 public:
  static void write(void* log, const dds_log_data* entry) {
    const std::string_view all(entry->message, entry->size);
    const std::string_view text = all.substr(std::min(entry->hdrsize, all.size()));
    if ((entry->priority & (kFatal | kError)) != 0)
      static_cast<Log*>(log)->set(shown(text));
    else if (const std::size_t at = text.find(kMalformed); at != text.npos)
      static_cast<Log*>(log)->warn(text.substr(at + kMalformed.size()));
    else
      spdlog::debug("Cyclone DDS: {}", shown(text));
  }
  std::string last_error() {
    const std::lock_guard lock(mutex_);
    return error_;
  }

 private:
  static constexpr std::string_view kMalformed = "deserialization rt";  // followed by TOPIC/TYPE

  void set(const std::string& error) {
    const std::lock_guard lock(mutex_);
    error_ = error;
  }
  void warn(std::string_view text) {
    const std::string_view name = text.substr(0, text.find(' '));
    const std::string topic = shown(name.substr(0, name.rfind('/')));
    const std::lock_guard lock(mutex_);
    if (malformed_.insert(topic).second)
      spdlog::warn("ros2: {} has messages that do not fit their type; they are skipped", topic);
  }
  std::mutex mutex_;
  std::string error_;
  std::set<std::string> malformed_;  // topics
};

Log& library_log() {
  static Log log;
  return log;
}

Functions load() {
  const RuntimeLibrary library(kFiles, {.need = "ROS 2 topics need Eclipse Cyclone DDS 0.10",
                                        .install = "install Debian's package cyclonedds-tools",
                                        .update = "install version 0.10"});
  Functions f;
#define CAIRN_FIND(name) library.find(#name, f.name);
  CAIRN_DDS(CAIRN_FIND)
#undef CAIRN_FIND
  f.dds_set_log_sink(Log::write, &library_log());
  return f;
}

const Functions& api() {
  static const Functions loaded = load();
  return loaded;
}

/// Returns the result, or throws its error.
dds_entity_t checked(dds_entity_t result, std::string_view task) {
  if (result >= 0) return result;
  const std::string error = library_log().last_error();
  throw std::runtime_error(
      fmt::format("{}: {}{}{}", task, api().dds_strretcode(result), error.empty() ? "" : ": ", error));
}

using Qos = std::unique_ptr<dds_qos, void (*)(dds_qos*)>;

Qos qos_of(bool reliable, bool transient_local, int depth) {
  Qos qos(api().dds_create_qos(), api().dds_delete_qos);
  api().dds_qset_reliability(qos.get(), reliable ? kReliable : kBestEffort, kMaxBlocking);
  api().dds_qset_durability(qos.get(), transient_local ? kTransientLocal : kVolatile);
  api().dds_qset_history(qos.get(), kKeepLast, depth);
  return qos;
}

dds_entity_t create_topic(dds_entity_t participant, const std::string& topic, const std::string& type) {
  const auto layout = ros2_layout(type);
  if (!layout) throw std::runtime_error(fmt::format("{}: the type {} is not supported", topic, type));
  const std::string type_name = to_dds_type(type);
  const dds_topic_descriptor descriptor{.m_size = layout->size,
                                        .m_align = alignof(void*),
                                        .m_flagset = kRestrictsRepresentation,
                                        .m_typename = type_name.c_str(),
                                        .m_nops = layout->count,
                                        .m_ops = layout->instructions.data(),
                                        .m_meta = "",
                                        .restrict_data_representation = kXcdr1};
  const std::string name = std::string(kTopicPrefix) + topic.substr(topic.starts_with('/') ? 1 : 0);
  return checked(api().dds_create_topic(participant, &descriptor, name.c_str(), nullptr, nullptr), topic);
}

/// Publication of a ROS 2 topic; nullopt for services, parameters and other programs.
std::optional<DdsPublication> publication_of(const dds_builtintopic_endpoint& endpoint) {
  const std::string_view topic = endpoint.topic_name == nullptr ? "" : endpoint.topic_name;
  std::string type = from_dds_type(endpoint.type_name == nullptr ? "" : endpoint.type_name);
  if (!topic.starts_with(kTopicPrefix) || type.empty()) return std::nullopt;
  int reliability = kBestEffort, durability = kVolatile;
  std::int64_t ignored = 0;
  if (endpoint.qos != nullptr) {
    api().dds_qget_reliability(endpoint.qos, &reliability, &ignored);
    api().dds_qget_durability(endpoint.qos, &durability);
  }
  return DdsPublication{.topic = "/" + std::string(topic.substr(kTopicPrefix.size())),
                        .type = std::move(type),
                        .reliable = reliability == kReliable,
                        .transient_local = durability >= kTransientLocal};
}

}  // namespace

DdsParticipant::DdsParticipant(std::uint32_t domain)
    : participant_(checked(api().dds_create_participant(domain, nullptr, nullptr),
                           fmt::format("the DDS domain {} cannot be joined", domain))) {
  try {
    waitset_ = checked(api().dds_create_waitset(participant_), "DDS");
    publications_ = checked(api().dds_create_reader(participant_, kPublications, nullptr, nullptr), "DDS");
  } catch (...) {
    api().dds_delete(participant_);
    throw;
  }
}

DdsParticipant::~DdsParticipant() { api().dds_delete(participant_); }

std::vector<DdsPublication> DdsParticipant::publications() const {
  std::vector<void*> samples(kMaxPublications);
  std::vector<dds_sample_info> infos(kMaxPublications);
  const std::int32_t count =
      api().dds_read(publications_, samples.data(), infos.data(), samples.size(), kMaxPublications);
  std::vector<DdsPublication> all;
  for (std::size_t i = 0; static_cast<std::int32_t>(i) < count; ++i) {
    if (!infos[i].valid_data || infos[i].instance_state != static_cast<int>(kAlive)) continue;
    if (auto publication = publication_of(*static_cast<const dds_builtintopic_endpoint*>(samples[i])))
      all.push_back(*std::move(publication));
  }
  if (count > 0) api().dds_return_loan(publications_, samples.data(), count);
  return all;
}

void DdsParticipant::await(Entity reader) const {
  const Entity condition = checked(api().dds_create_readcondition(reader, kAnyState), "DDS");
  checked(api().dds_waitset_attach(waitset_, condition, 0), "DDS");
}

DdsParticipant::Entity DdsParticipant::add_reader(const std::string& topic, const std::string& type,
                                                  const DdsReaderOptions& options) {
  const Entity entity = create_topic(participant_, topic, type);
  const Qos qos = qos_of(options.reliable, options.transient_local, options.depth);
  const Entity reader = checked(api().dds_create_reader(participant_, entity, qos.get(), nullptr), topic);
  api().dds_delete(entity);  // the reader keeps it
  await(reader);
  return reader;
}

void DdsParticipant::remove_reader(Entity reader) { api().dds_delete(reader); }

DdsParticipant::Entity DdsParticipant::add_writer(const std::string& topic, const std::string& type,
                                                  const DdsWriterOptions& options) {
  const Entity entity = create_topic(participant_, topic, type);
  const Qos qos = qos_of(true, false, options.depth);
  const Entity writer = checked(api().dds_create_writer(participant_, entity, qos.get(), nullptr), topic);
  api().dds_delete(entity);
  return writer;
}

void DdsParticipant::write(Entity writer, const void* message) const {
  checked(api().dds_write(writer, message), "a message cannot be published");
}

std::vector<DdsMessage> DdsParticipant::take(Entity reader) const {
  std::array<ddsi_serdata*, kMaxTaken> samples{};
  std::array<dds_sample_info, kMaxTaken> infos{};
  std::vector<DdsMessage> messages;
  std::int32_t count = 0;
  do {
    count = api().dds_takecdr(reader, samples.data(), kMaxTaken, infos.data(), kAnyState);
    for (std::size_t i = 0; static_cast<std::int32_t>(i) < count; ++i) {
      if (infos[i].valid_data) {
        DdsMessage& message = messages.emplace_back(DdsMessage{.sent = infos[i].source_timestamp, .bytes = {}});
        message.bytes.resize(api().ddsi_serdata_size(samples[i]));
        api().ddsi_serdata_to_ser(samples[i], 0, message.bytes.size(), message.bytes.data());
      }
      api().ddsi_serdata_unref(samples[i]);
    }
  } while (count == static_cast<std::int32_t>(kMaxTaken));
  return messages;
}

bool DdsParticipant::wait(std::chrono::milliseconds timeout) const {
  return api().dds_waitset_wait(waitset_, nullptr, 0, std::chrono::nanoseconds(timeout).count()) > 0;
}

}  // namespace cairn
