// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Last step of an iteration: adds the sums and takes one Gauss-Newton step, with each term scaled by its own residual
// variance. Directions not observed by the geometry are left to brightness, and directions observed by neither keep the
// initial guess (Zhang, Kaess & Singh 2016). Then selects the next step: another iteration, the next finer level, or
// none. One workgroup; after the summation all threads compute the same, and the first writes.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/track.h"
layout(local_size_x = 64, local_size_x_id = 15) in;
layout(push_constant, scalar) uniform Push { PoseStepPush push; };
WORDS(0, geometry);     // IcpSums as words
WORDS(1, crossed);      // IcpSums as words, for crossed pairs of normals
WORDS(2, photometric);  // PhotometricSums as words
layout(binding = 3, scalar) buffer State { AlignState state; };

const int kIcpWords = 32, kPhotometricWords = 36;  // the last word is the number of parts per workgroup
const int kAll = 2 * kIcpWords + kPhotometricWords;
shared float total[kAll];

const float kMinBrightnessSigma = 1.0 / 255.0;
const float kMinDepthSigma = 0.1;    // standard deviations of the depth noise
const float kWeakGeometry = 0.002;   // minimum share of a direction in the sum of eigenvalues
const float kAgreeing = 0.75;        // minimum share of inliers
const float kUnobserved = 1e-5;      // relative to the strongest direction
const float kMinInliers = 6.0;
// Brightness residuals of adjacent pixels are correlated, so many count as few. Sensor noise is correlated by
// interpolation only; the rest of the variance is calibration, shutter and shading, which are common to entire objects.
const float kBrightnessNoise = 0.015;  // standard deviation, brightness in 0..1
const float kCorrelatedNoise = 10.0;  // residuals that count as one independent residual
const float kCorrelatedSystematic = 60.0;
const float kMinPhotometricShare = 0.05;  // minimum share of pixels with a brightness in both images

struct Equations {  // a x = b for x = (rotation, translation); a is symmetric
  mat3 rr, rt, tt;
  vec3 br, bt;
};

mat3 symmetric(vec3 first, vec3 rest) { return mat3(first, first.y, rest.xy, first.z, rest.yz); }
vec3 row(mat3 m, int i) { return vec3(m[0][i], m[1][i], m[2][i]); }
vec3 total_at(int word) { return vec3(total[word], total[word + 1], total[word + 2]); }

Equations equations_at(int word) {  // reads NormalEquations
  Equations e;
  e.rr = symmetric(total_at(word), total_at(word + 3));
  e.rt = transpose(mat3(total_at(word + 6), total_at(word + 9), total_at(word + 12)));
  e.tt = symmetric(total_at(word + 15), total_at(word + 18));
  e.br = total_at(word + 21);
  e.bt = total_at(word + 24);
  return e;
}

// Transforms the equations from the frame of `e` to the source frame of `motion`.
Equations moved(Equations e, Rigid motion) {
  mat3 r = mat3(motion.x, motion.y, motion.z);
  mat3 s = mat3(cross(motion.t, motion.x), cross(motion.t, motion.y), cross(motion.t, motion.z));
  mat3 rt = transpose(r), st = transpose(s), tr = transpose(e.rt);
  Equations m;
  m.rr = rt * (e.rr * r + e.rt * s) + st * (tr * r + e.tt * s);
  m.rt = (rt * e.rt + st * e.tt) * r;
  m.tt = rt * e.tt * r;
  m.br = rt * e.br + st * e.bt;
  m.bt = rt * e.bt;
  return m;
}

Equations sum_of(Equations a, float s, Equations b, float t) {
  return Equations(a.rr * s + b.rr * t, a.rt * s + b.rt * t, a.tt * s + b.tt * t, a.br * s + b.br * t, a.bt * s + b.bt * t);
}

// Lever arm in meters per radian, to compare rotations with translations.
float lever_of(Equations e) {
  return max(sqrt((e.rr[0][0] + e.rr[1][1] + e.rr[2][2]) / max(e.tt[0][0] + e.tt[1][1] + e.tt[2][2], 1e-12)), 1e-3);
}

// Eigenvalues and eigenvectors (rotation in `r`, translation in `t`) of a, with rotations scaled by the lever: cyclic
// Jacobi method (Golub & Van Loan 2013, sec. 8.5). All indices are literals: on a CPU device, dynamic indexing of an
// array goes through memory, lane by lane.
struct Directions {
  float value[6];
  vec3 r[6], t[6];
};
#define AT(i, j) ((i) <= (j) ? (i) * (11 - (i)) / 2 + (j) : (j) * (11 - (j)) / 2 + (i))
#define MIX(k, p, q)                                          \
  if (k != p && k != q) {                                     \
    float kp = a[AT(k, p)], kq = a[AT(k, q)];                 \
    a[AT(k, p)] = c * kp - s * kq, a[AT(k, q)] = s * kp + c * kq; \
  }
#define TURN(p, q)                                                                       \
  {                                                                                      \
    float pq = a[AT(p, q)], theta = (a[AT(q, q)] - a[AT(p, p)]) / (2.0 * pq);            \
    float by = pq == 0.0 ? 0.0 : (theta < 0.0 ? -1.0 : 1.0) / (abs(theta) + sqrt(theta * theta + 1.0)); \
    float c = 1.0 / sqrt(by * by + 1.0), s = by * c;                                     \
    a[AT(p, p)] -= by * pq, a[AT(q, q)] += by * pq, a[AT(p, q)] = 0.0;                   \
    MIX(0, p, q) MIX(1, p, q) MIX(2, p, q) MIX(3, p, q) MIX(4, p, q) MIX(5, p, q)        \
    vec3 rp = r[p], rq = r[q], tp = t[p], tq = t[q];                                     \
    r[p] = c * rp - s * rq, r[q] = s * rp + c * rq;                                      \
    t[p] = c * tp - s * tq, t[q] = s * tp + c * tq;                                      \
  }
Directions directions_of(Equations e, float lever) {
  float l = 1.0 / lever, l2 = l * l;
  float a[21] = float[](e.rr[0][0] * l2, e.rr[1][0] * l2, e.rr[2][0] * l2, e.rt[0][0] * l, e.rt[1][0] * l, e.rt[2][0] * l,
                        e.rr[1][1] * l2, e.rr[2][1] * l2, e.rt[0][1] * l, e.rt[1][1] * l, e.rt[2][1] * l,
                        e.rr[2][2] * l2, e.rt[0][2] * l, e.rt[1][2] * l, e.rt[2][2] * l,
                        e.tt[0][0], e.tt[1][0], e.tt[2][0], e.tt[1][1], e.tt[2][1], e.tt[2][2]);
  vec3 x = vec3(1, 0, 0), y = vec3(0, 1, 0), z = vec3(0, 0, 1), o = vec3(0);
  vec3 r[6] = vec3[](x, y, z, o, o, o), t[6] = vec3[](o, o, o, x, y, z);
  for (int sweep = 0; sweep < 8; ++sweep) {
    TURN(0, 1) TURN(0, 2) TURN(0, 3) TURN(0, 4) TURN(0, 5)
    TURN(1, 2) TURN(1, 3) TURN(1, 4) TURN(1, 5)
    TURN(2, 3) TURN(2, 4) TURN(2, 5)
    TURN(3, 4) TURN(3, 5)
    TURN(4, 5)
  }
  return Directions(float[](max(a[AT(0, 0)], 0.0), max(a[AT(1, 1)], 0.0), max(a[AT(2, 2)], 0.0), max(a[AT(3, 3)], 0.0),
                            max(a[AT(4, 4)], 0.0), max(a[AT(5, 5)], 0.0)),
                    r, t);
}

// Directions of the pose observed by the geometry. Noise of the normals would hold the other directions at the guess
// (Zhang, Kaess & Singh 2016, sec. III, applied to the matrix that pairs live normals with the model's: noise is
// independent in the two, structure is common).
struct Observed {
  mat3 rr, rt, tt;  // sum of the dyads of the observed directions
  float lever;
  uint weak;
};
const Observed kAllObserved = Observed(mat3(1.0), mat3(0.0), mat3(1.0), 1.0, 0u);

#define KEEP(i)                                  \
  {                                              \
    bool is_weak = d.value[i] < kWeakGeometry * all; \
    float keep = is_weak ? 0.0 : 1.0;            \
    o.rr += outerProduct(d.r[i], d.r[i]) * keep; \
    o.rt += outerProduct(d.r[i], d.t[i]) * keep; \
    o.tt += outerProduct(d.t[i], d.t[i]) * keep; \
    o.weak += is_weak ? 1u : 0u;                 \
  }
Observed observed_by_geometry(Equations pairs) {
  Observed o = Observed(mat3(0.0), mat3(0.0), mat3(0.0), lever_of(pairs), 0u);
  Directions d = directions_of(pairs, o.lever);
  float all = d.value[0] + d.value[1] + d.value[2] + d.value[3] + d.value[4] + d.value[5];
  KEEP(0) KEEP(1) KEEP(2) KEEP(3) KEEP(4) KEEP(5)
  if (o.weak == 0u) o = kAllObserved;
  return o;
}

// Projects the unobserved directions out of the equations.
Equations projected(Equations e, Observed o) {
  float l = 1.0 / o.lever, l2 = l * l;
  mat3 rr = e.rr * l2, rt = e.rt * l, tr = transpose(rt), ko = transpose(o.rt);
  // Blocks of k a, then of (k a) k.
  mat3 p = o.rr * rr + o.rt * tr, q = o.rr * rt + o.rt * e.tt, u = ko * rr + o.tt * tr, v = ko * rt + o.tt * e.tt;
  vec3 br = e.br * l;
  Equations m;
  m.rr = (p * o.rr + q * ko) * (o.lever * o.lever);
  m.rt = (p * o.rt + q * o.tt) * o.lever;
  m.tt = u * o.rt + v * o.tt;
  m.br = (o.rr * br + o.rt * e.bt) * o.lever;
  m.bt = ko * br + o.tt * e.bt;
  return m;
}

// Solves the equations; x has no component along unobserved directions.
struct Solution {
  vec3 rotation, translation;
  uint unobserved;
  bool exists;
};
#define ADD(i)                                                                                   \
  {                                                                                              \
    bool is_seen = d.value[i] > kUnobserved * strongest;                                         \
    float y = is_seen ? (dot(d.r[i], br) + dot(d.t[i], e.bt)) / d.value[i] : 0.0;                \
    x.rotation += d.r[i] * y, x.translation += d.t[i] * y, x.unobserved += is_seen ? 0u : 1u;    \
  }
Solution solve(Equations e) {
  float lever = lever_of(e);
  Directions d = directions_of(e, lever);
  float strongest = max(max(max(d.value[0], d.value[1]), max(d.value[2], d.value[3])), max(d.value[4], d.value[5]));
  vec3 br = e.br / lever;
  Solution x = Solution(vec3(0), vec3(0), 0u, false);
  ADD(0) ADD(1) ADD(2) ADD(3) ADD(4) ADD(5)
  x.rotation /= lever;
  float size = dot(x.rotation, x.rotation) + dot(x.translation, x.translation);
  x.exists = strongest > 0.0 && !isinf(strongest) && !isnan(size) && !isinf(size);
  return x;
}

// Rotates v by the rotation vector `turn`.
vec3 turned(vec3 turn, vec3 v) {
  float angle = length(turn);
  bool small = angle < 1e-3;
  float half_sine = sin(0.5 * angle) / (small ? 1.0 : angle);
  float first = small ? 1.0 - angle * angle / 6.0 : sin(angle) / angle, second = small ? 0.5 : 2.0 * half_sine * half_sine;
  vec3 across = cross(turn, v);
  return v + first * across + second * cross(turn, across);
}

Groups groups(uint count) { return Groups(count, 1u, 1u); }

float word_of(itextureBuffer sums, int i) { return uintBitsToFloat(fetch(sums, i)); }

void main() {
  int thread = int(gl_LocalInvocationIndex), threads = int(gl_WorkGroupSize.x);
  bool is_finest = push.level == push.finest;
  uint directions = state.directions, iteration = state.iteration;
  bool checks_degeneracy = is_finest && iteration == 0u && directions != kWithAll;
  int parts = int(push.groups * fetch(geometry, kIcpWords - 1));
  int crossed_parts = checks_degeneracy ? parts : 0;
  int photometric_parts = push.has_brightness != 0u ? int(push.groups * fetch(photometric, kPhotometricWords - 1)) : 0;
  for (int word = thread; word < kIcpWords; word += threads) {
    float sum = 0.0, pairs = 0.0;
    for (int part = 0; part < parts; ++part) sum += word_of(geometry, part * kIcpWords + word);
    for (int part = 0; part < crossed_parts; ++part) pairs += word_of(crossed, part * kIcpWords + word);
    total[word] = sum;
    total[kIcpWords + word] = pairs;
  }
  for (int word = thread; word < kPhotometricWords; word += threads) {
    float sum = 0.0;
    for (int part = 0; part < photometric_parts; ++part) sum += word_of(photometric, part * kPhotometricWords + word);
    total[2 * kIcpWords + word] = sum;
  }
  barrier();

  float squared = total[27], inliers = total[28], seen = total[29];
  float sigma = state.sigma, stride = float(state.stride);

  // Directions that the geometry may move.
  Observed observed = Observed(symmetric(state.keep_rr0, state.keep_rr1),
                               transpose(mat3(state.keep_rt0, state.keep_rt1, state.keep_rt2)),
                               symmetric(state.keep_tt0, state.keep_tt1), state.lever, state.weak);
  bool goes_on = true;
  if (checks_degeneracy) {
    // Normals of surfaces that are not aligned yet carry no information about noise. In a young map normals disagree
    // even when aligned; brightness that fits to its noise without the weak directions proves the alignment.
    bool agree = inliers > kAgreeing * seen, close = total[kIcpWords + 28] > kAgreeing * seen;
    bool proved = directions == kWithoutWeak && sigma < kBrightnessNoise;
    bool can_repeat = push.has_brightness != 0u && push.has_coarser != 0u, trial = directions == kUndecided && can_repeat;
    observed = kAllObserved;
    if (agree || (close && (proved || trial))) observed = observed_by_geometry(equations_at(kIcpWords));
    goes_on = !can_repeat || (directions == kUndecided ? observed.weak == 0u : agree || proved);
    if (!goes_on) directions = directions == kUndecided ? kWithoutWeak : kWithAll;
  }

  bool has_geometry = inliers >= kMinInliers;
  float variance = max(squared / max(inliers, 1.0), kMinDepthSigma * kMinDepthSigma);
  Equations e = projected(equations_at(0), observed);

  int at = 2 * kIcpWords + 27;
  float key_squared = total[at], key_seen = total[at + 1], fitting = total[at + 2];
  float weight = total[at + 3], mean_live = total[at + 4] / max(weight, 1e-12), mean_key = total[at + 5] / max(weight, 1e-12);
  float spread = total[at + 6] / max(weight, 1e-12) - mean_live * mean_live;
  float covariance = total[at + 7] / max(weight, 1e-12) - mean_live * mean_key;
  bool uses_brightness = key_seen * stride * stride > kMinPhotometricShare * push.pixels;
  // Kerl, Sturm & Cremers 2013, eq. 15: one fixed-point step per iteration.
  float key_sigma = max(sqrt(key_squared / max(key_seen, 1.0)), kMinBrightnessSigma), all = key_sigma * key_sigma;
  float noise = min(all, kBrightnessNoise * kBrightnessNoise);
  float key_variance = kCorrelatedNoise * noise + kCorrelatedSystematic * (all - noise);
  e = sum_of(e, has_geometry ? 1.0 / variance : 0.0, moved(equations_at(2 * kIcpWords), local(push.keyframe_from_model)),
             uses_brightness ? 1.0 / key_variance : 0.0);
  // Gain and bias by weighted linear regression of the keyframe's brightness on the live brightness.
  float gain = spread > 1e-4 ? clamp(covariance / spread, 0.3, 3.0) : 1.0;

  Solution x = solve(e);
  float change = sqrt(dot(x.rotation, x.rotation) + dot(x.translation, x.translation));
  bool moves_on = x.exists && change >= (state.stride == 1u ? push.converged : push.converged_sparse);

  if (thread != 0) return;
  state.weak = observed.weak, state.lever = observed.lever;
  state.keep_rr0 = observed.rr[0], state.keep_rr1 = vec3(observed.rr[1].yz, observed.rr[2].z);
  state.keep_rt0 = row(observed.rt, 0), state.keep_rt1 = row(observed.rt, 1), state.keep_rt2 = row(observed.rt, 2);
  state.keep_tt0 = observed.tt[0], state.keep_tt1 = vec3(observed.tt[1].yz, observed.tt[2].z);
  state.directions = directions;
  state.iterations[push.level] = iteration + 1u;
  state.sums[push.level] = groups(0u);
  state.steps[push.level] = groups(0u);
  state.crossed = groups(0u);
  if (!goes_on) {
    state.outcome = kAgain;
    return;
  }

  if (x.exists) {
    Rigid pose = local(state.model_from_live);
    state.model_from_live = Rigid(turned(x.rotation, pose.x), turned(x.rotation, pose.y), turned(x.rotation, pose.z),
                                  turned(x.rotation, pose.t) + x.translation);
  }
  if (uses_brightness) state.sigma = key_sigma, state.gain = gain, state.bias = mean_key - gain * mean_live;
  state.uses_brightness = uses_brightness ? 1u : 0u;
  state.normal = NormalEquations(e.rr[0], vec3(e.rr[1].yz, e.rr[2].z), row(e.rt, 0), row(e.rt, 1), row(e.rt, 2), e.tt[0],
                                 vec3(e.tt[1].yz, e.tt[2].z), e.br, e.bt);
  state.squared = squared, state.inliers = inliers, state.seen = seen, state.live = total[30];
  state.photometric_seen = key_seen, state.photometric_fitting = fitting;
  state.degenerate_directions = has_geometry ? observed.weak : 6u;
  state.unobserved = x.unobserved;

  // Close to convergence all pixels are used, at least in the last two iterations.
  bool was_near = state.is_near != 0u, is_last = (was_near && !moves_on) || iteration + 1u >= push.max_iterations;
  bool is_near = was_near || !moves_on || iteration + 2u >= push.max_iterations;
  uint level = push.level, count = push.groups;
  ++iteration;
  if (is_last && !is_finest) --level, count = push.next_groups, iteration = 0u, is_near = level != push.finest;
  bool is_done = is_last && is_finest, weak_next = level == push.finest && iteration == 0u && directions != kWithAll;
  state.level = level, state.iteration = iteration;
  state.is_near = is_near ? 1u : 0u;
  state.stride = is_done || is_near || weak_next ? 1u : kSparse;
  if (is_done) {
    state.outcome = kDone;
    state.clocks = groups(uses_brightness ? push.clock_groups : 0u);
    return;
  }
  state.sums[level] = groups(count);
  state.steps[level] = groups(1u);
  state.crossed = groups(weak_next ? count : 0u);
}
