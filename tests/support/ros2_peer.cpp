// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/ros2_peer.hpp"

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <dds/ddsi/q_radmin.h>

#include <array>
#include <cstring>
#include <memory>
#include <stdexcept>

namespace cairn::ros {
namespace {

/// A message of any type: its bytes.
struct RawMessage : ddsi_serdata {
  std::string bytes;
};
const std::string& bytes_of(const ddsi_serdata* d) { return static_cast<const RawMessage*>(d)->bytes; }

ddsi_serdata* message_of(const ddsi_sertype* type, ddsi_serdata_kind kind, std::string bytes) {
  auto* message = new RawMessage;
  ddsi_serdata_init(message, type, kind);
  message->bytes = std::move(bytes);
  return message;
}

ddsi_serdata* from_fragments(const ddsi_sertype* type, ddsi_serdata_kind kind, const nn_rdata* fragment,
                             std::size_t size) {
  std::string bytes;
  for (; fragment != nullptr; fragment = fragment->nextfrag) {
    if (fragment->maxp1 <= bytes.size()) continue;
    const unsigned char* payload = NN_RMSG_PAYLOADOFF(fragment->rmsg, NN_RDATA_PAYLOAD_OFF(fragment));
    bytes.append(reinterpret_cast<const char*>(payload) + bytes.size() - fragment->min, fragment->maxp1 - bytes.size());
  }
  bytes.resize(size);
  return message_of(type, kind, std::move(bytes));
}
ddsi_serdata* from_parts(const ddsi_sertype* type, ddsi_serdata_kind kind, std::size_t count, const iovec* parts,
                         std::size_t) {
  std::string bytes;
  for (std::size_t i = 0; i < count; ++i) bytes.append(static_cast<const char*>(parts[i].iov_base), parts[i].iov_len);
  return message_of(type, kind, std::move(bytes));
}
void copy_out(const ddsi_serdata* d, std::size_t offset, std::size_t size, void* to) {
  std::memcpy(to, bytes_of(d).data() + offset, size);
}
ddsi_serdata* refer(const ddsi_serdata* d, std::size_t offset, std::size_t size, iovec* part) {
  part->iov_base = const_cast<char*>(bytes_of(d).data()) + offset;
  part->iov_len = size;
  return ddsi_serdata_ref(d);
}

const ddsi_serdata_ops kMessageOps = [] {
  ddsi_serdata_ops ops{};
  ops.eqkey = [](const ddsi_serdata*, const ddsi_serdata*) { return true; };
  ops.get_size = [](const ddsi_serdata* d) { return static_cast<std::uint32_t>(bytes_of(d).size()); };
  ops.from_ser = from_fragments;
  ops.from_ser_iov = from_parts;
  ops.from_keyhash = [](const ddsi_sertype* type, const ddsi_keyhash*) { return message_of(type, SDK_KEY, {}); };
  ops.from_sample = [](const ddsi_sertype* type, ddsi_serdata_kind kind, const void* sample) {
    std::string bytes = kind == SDK_DATA ? *static_cast<const std::string*>(sample) : std::string();
    bytes.resize((bytes.size() + 3) / 4 * 4);
    return message_of(type, kind, std::move(bytes));
  };
  ops.to_ser = copy_out;
  ops.to_ser_ref = refer;
  ops.to_ser_unref = [](ddsi_serdata* d, const iovec*) { ddsi_serdata_unref(d); };
  ops.to_sample = [](const ddsi_serdata* d, void* sample, void**, void*) {
    *static_cast<std::string*>(sample) = bytes_of(d);
    return true;
  };
  ops.to_untyped = [](const ddsi_serdata* d) { return message_of(d->type, SDK_KEY, {}); };
  ops.untyped_to_sample = [](const ddsi_sertype*, const ddsi_serdata*, void*, void**, void*) { return true; };
  ops.free = [](ddsi_serdata* d) { delete static_cast<RawMessage*>(d); };
  ops.print = [](const ddsi_sertype*, const ddsi_serdata*, char* text, std::size_t size) -> std::size_t {
    if (size > 0) *text = 0;
    return 0;
  };
  ops.get_keyhash = [](const ddsi_serdata*, ddsi_keyhash* hash, bool) { std::memset(hash, 0, sizeof *hash); };
  return ops;
}();

const ddsi_sertype_ops kTypeOps = [] {
  ddsi_sertype_ops ops{};
  ops.version = ddsi_sertype_v0;
  ops.free = [](ddsi_sertype* type) {
    ddsi_sertype_fini(type);
    delete type;
  };
  ops.zero_samples = [](const ddsi_sertype*, void*, std::size_t) {};
  ops.realloc_samples = [](void**, const ddsi_sertype*, void*, std::size_t, std::size_t) {};
  ops.free_samples = [](const ddsi_sertype*, void**, std::size_t, dds_free_op_t) {};
  ops.equal = [](const ddsi_sertype*, const ddsi_sertype*) { return true; };  // of the same name
  ops.hash = [](const ddsi_sertype*) -> std::uint32_t { return 7; };
  ops.derive_sertype = [](const ddsi_sertype* type, dds_data_representation_id_t,
                          dds_type_consistency_enforcement_qospolicy_t) { return const_cast<ddsi_sertype*>(type); };
  return ops;
}();

dds_entity_t checked(dds_entity_t entity) {
  if (entity < 0) throw std::runtime_error(dds_strretcode(entity));
  return entity;
}

using DdsQos = std::unique_ptr<dds_qos_t, void (*)(dds_qos_t*)>;
DdsQos qos_of(const Ros2Peer::Qos& wanted) {
  DdsQos qos(dds_create_qos(), dds_delete_qos);
  dds_qset_reliability(qos.get(), wanted.reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                       DDS_SECS(1));
  dds_qset_durability(qos.get(), wanted.transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, 100);
  dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, 100, -1, -1, -1);
  return qos;
}

}  // namespace

Ros2Peer::Ros2Peer(std::uint32_t domain) : participant_(checked(dds_create_participant(domain, nullptr, nullptr))) {}
Ros2Peer::~Ros2Peer() { dds_delete(participant_); }

std::int32_t Ros2Peer::topic_of(const std::string& topic, const std::string& type) {
  const std::size_t slash = type.find('/');
  const std::string name = type.substr(0, slash) + "::msg::dds_::" + type.substr(slash + 1) + "_";
  auto* raw = new ddsi_sertype{};
  ddsi_sertype_init(raw, name.c_str(), &kTypeOps, &kMessageOps, true);
  raw->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
  return checked(dds_create_topic_sertype(participant_, ("rt" + topic).c_str(), &raw, nullptr, nullptr, nullptr));
}

void Ros2Peer::announce(const std::string& topic, const std::string& type, const Qos& qos) {
  writers_[topic] = checked(dds_create_writer(participant_, topic_of(topic, type), qos_of(qos).get(), nullptr));
}

void Ros2Peer::publish(const std::string& topic, const std::string& type, const std::string& bytes) {
  if (!writers_.contains(topic)) announce(topic, type, {});
  checked(dds_write(writers_.at(topic), &bytes));
}

int Ros2Peer::readers(const std::string& topic) const {
  return checked(dds_get_matched_subscriptions(writers_.at(topic), nullptr, 0));
}

void Ros2Peer::withdraw(const std::string& topic) {
  dds_delete(writers_.at(topic));
  writers_.erase(topic);
}

void Ros2Peer::subscribe(const std::string& topic, const std::string& type, const Qos& qos) {
  readers_[topic] = checked(dds_create_reader(participant_, topic_of(topic, type), qos_of(qos).get(), nullptr));
}

std::vector<std::string> Ros2Peer::received(const std::string& topic) {
  std::array<ddsi_serdata*, 100> samples{};
  std::array<dds_sample_info_t, 100> infos{};
  const dds_return_t count = dds_takecdr(readers_.at(topic), samples.data(), 100, infos.data(), DDS_ANY_STATE);
  std::vector<std::string> all;
  for (std::size_t i = 0; static_cast<dds_return_t>(i) < count; ++i) {
    if (infos[i].valid_data) all.push_back(bytes_of(samples[i]));
    ddsi_serdata_unref(samples[i]);
  }
  return all;
}

std::vector<std::size_t> dds_struct_layout() {
  using D = dds_topic_descriptor_t;
  using E = dds_builtintopic_endpoint_t;
  using I = dds_sample_info_t;
  using L = dds_log_data_t;
  return {sizeof(D),
          offsetof(D, m_flagset),
          offsetof(D, m_typename),
          offsetof(D, m_ops),
          offsetof(D, type_information),
          offsetof(D, restrict_data_representation),  //
          sizeof(I),
          offsetof(I, instance_state),
          offsetof(I, valid_data),
          offsetof(I, source_timestamp),
          sizeof(E),
          offsetof(E, topic_name),
          offsetof(E, type_name),
          offsetof(E, qos),  //
          sizeof(L),
          offsetof(L, message),
          offsetof(L, size),
          offsetof(L, hdrsize)};
}

}  // namespace cairn::ros
