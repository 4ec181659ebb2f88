// Sums as bytes: "heftsums", version, contents, a hash of all before it.
#include <bit>
#include <cstring>
#include <type_traits>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/hash.hpp"
#include "heft/identify/sums.hpp"

namespace heft::identify {
namespace {

static_assert(std::endian::native == std::endian::little, "sums are sent as they lie in memory");

constexpr std::string_view kMagic = "heftsums";
constexpr std::uint32_t kVersion = 2;
constexpr std::size_t kHash = sizeof(std::uint64_t);

/// Appends what it is called with.
class Writer {
 public:
  static constexpr bool kReads = false;

  template <typename Number>
  void number(const Number& value) {
    static_assert(std::is_arithmetic_v<Number>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void size(std::size_t& value, std::size_t /*least*/) { number(static_cast<std::uint64_t>(value)); }
  void text(std::string& value) {
    number(static_cast<std::uint64_t>(value.size()));
    bytes_ += value;
  }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

/// Takes the same things in the same order.
class Reader {
 public:
  static constexpr bool kReads = true;

  Reader(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  template <typename Number>
  void number(Number& value) {
    static_assert(std::is_arithmetic_v<Number>);
    expect(sizeof value);
    std::memcpy(&value, bytes_.data(), sizeof value);
    bytes_.remove_prefix(sizeof value);
  }
  /// A count of things of at least so many bytes each: nothing is made room for that cannot follow.
  void size(std::size_t& value, std::size_t least) {
    std::uint64_t count = 0;
    number(count);
    if (count > bytes_.size() / least) refuse();
    value = count;
  }
  void text(std::string& value) {
    std::size_t length = 0;
    size(length, 1);
    value = bytes_.substr(0, length);
    bytes_.remove_prefix(length);
  }
  void end() const {
    if (!bytes_.empty()) refuse();
  }
  [[noreturn]] void refuse() const {
    throw DataError(fmt::format(
        "{}: found contents that do not fit together; expected sums as heft writes them; make them again from the logs",
        name_));
  }

 private:
  void expect(std::size_t count) const {
    if (bytes_.size() < count) refuse();
  }
  std::string_view bytes_;
  const std::string& name_;
};

// One description for both directions: `Stream` is a Writer or a Reader.

template <typename Stream>
void vector_of(Stream& s, Eigen::VectorXd& values) {
  auto count = static_cast<std::size_t>(values.size());
  s.size(count, sizeof(double));
  values.resize(static_cast<Eigen::Index>(count));
  for (double& value : values) s.number(value);
}

/// An enumeration or a flag as one byte.
template <typename Stream, typename Value>
void small(Stream& s, Value& value, int last) {
  auto byte = static_cast<std::uint8_t>(value);
  s.number(byte);
  if constexpr (Stream::kReads) {
    if (byte > last) s.refuse();
    value = static_cast<Value>(byte);
  }
}

template <typename Stream, typename Item, typename Each>
void items(Stream& s, std::vector<Item>& list, std::size_t least, Each&& each) {
  std::size_t count = list.size();
  s.size(count, least);
  list.resize(count);
  for (Item& item : list) each(item);
}

template <typename Stream>
void judgement(Stream& s, host::Judgement& torque) {
  std::vector<std::string> reasons = torque.reasons;
  host::Verdict verdict = torque.verdict;
  small(s, verdict, static_cast<int>(host::Verdict::kBad));
  items(s, reasons, sizeof(std::uint64_t), [&](std::string& reason) { s.text(reason); });
  if constexpr (Stream::kReads) {
    for (const std::string& reason : reasons) torque.add(verdict, reason);
  }
}

template <typename Stream>
void log_share(Stream& s, LogShare& log) {
  data::StreamSummary& summary = log.summary;
  s.text(summary.path);
  s.number(summary.num_joints);
  s.number(summary.samples);
  for (double* value : {&summary.begin, &summary.end, &summary.sample_rate, &summary.cutoff,
                        &summary.bandwidth, &summary.moving_from, &summary.moving_to})
    s.number(*value);
  for (bool* flag :
       {&summary.resampled, &summary.velocity_logged, &summary.acceleration_logged, &summary.cutoff_chosen})
    small(s, *flag, 1);
  for (Eigen::VectorXd* values :
       {&summary.travel, &summary.top_speed, &summary.max_torque, &log.correlation_time})
    vector_of(s, *values);
  items(s, summary.notes, sizeof(std::uint64_t), [&](std::string& note) { s.text(note); });
  s.number(log.key);
  judgement(s, log.torque);
}

/// Rows and columns of a triangle that hold anything: a joint's rows have zeros for every link before it.
std::vector<std::uint16_t> used_columns(const Eigen::MatrixXd& R) {
  std::vector<std::uint16_t> used;
  for (Eigen::Index c = 0; c < R.cols(); ++c) {
    if ((R.col(c).array() != 0.0).any() || (R.row(c).array() != 0.0).any())
      used.push_back(static_cast<std::uint16_t>(c));
  }
  return used;
}

template <typename Stream>
void triangle(Stream& s, int columns, regression::TriangularFactor& factor) {
  Eigen::MatrixXd R = Stream::kReads ? Eigen::MatrixXd::Zero(columns + 1, columns + 1) : factor.full();
  long rows = factor.rows();
  s.number(rows);
  std::vector<std::uint16_t> used = used_columns(R);
  items(s, used, sizeof(std::uint16_t), [&](std::uint16_t& column) { s.number(column); });
  for (std::size_t c = 0; c < used.size(); ++c) {
    if constexpr (Stream::kReads) {
      if (used[c] > columns || (c > 0 && used[c] <= used[c - 1])) s.refuse();
    }
    for (std::size_t r = 0; r <= c; ++r) s.number(R(used[r], used[c]));
  }
  if constexpr (Stream::kReads) factor = regression::TriangularFactor(std::move(R), rows);
}

void write_factors(Writer& s, const regression::BlockFactors& factors) {
  s.number(static_cast<std::int32_t>(factors.num_joints()));
  s.number(static_cast<std::int32_t>(factors.num_columns()));
  s.number(static_cast<std::int32_t>(factors.max_blocks()));
  s.number(static_cast<std::int32_t>(factors.partition().level()));
  s.number(factors.partition().first_length());
  s.number(static_cast<std::uint64_t>(factors.num_blocks()));
  for (int b = 0; b < factors.num_blocks(); ++b) {
    s.number(factors.key(b).log);
    s.number(factors.key(b).index);
    for (int j = 0; j < factors.num_joints(); ++j) {
      regression::TriangularFactor factor = factors.factor(b, j);
      triangle(s, factors.num_columns(), factor);
    }
  }
}

regression::BlockFactors read_factors(Reader& s) {
  constexpr std::int32_t kMostJoints = 64, kMostColumns = 4096, kMostBlocks = 1 << 20;
  std::int32_t joints = 0, columns = 0, most = 0, level = 0;
  double first = 0.0;
  for (std::int32_t* value : {&joints, &columns, &most, &level}) s.number(*value);
  s.number(first);
  std::size_t count = 0;
  s.size(count, sizeof(regression::BlockPartition::Key));
  if (joints < 1 || joints > kMostJoints || columns < 1 || columns > kMostColumns || most < 1 ||
      most > kMostBlocks || level < 0 || !(first > 0.0) || count > static_cast<std::size_t>(most))
    s.refuse();
  regression::BlockFactors factors(joints, columns, first, most);
  factors.coarsen_to(level);
  for (std::size_t b = 0; b < count; ++b) {
    regression::BlockPartition::Key key;
    s.number(key.log);
    s.number(key.index);
    for (int j = 0; j < joints; ++j) {
      regression::TriangularFactor factor(columns);
      triangle(s, columns, factor);
      factors.put(key, j, std::move(factor));
    }
  }
  return factors;
}

template <typename Stream>
void settings(Stream& s, Sums& sums) {
  s.text(sums.robot);
  s.number(sums.geometry);
  small(s, sums.torque_at, static_cast<int>(data::TorqueAt::kJoint));
  regression::ModelStructure& structure = sums.structure;
  for (bool* flag : {&structure.rotor_inertia, &structure.coulomb, &structure.viscous, &structure.offset})
    small(s, *flag, 1);
  items(s, structure.couplings, 2 * sizeof(int) + sizeof(double), [&](GearCoupling<double>& coupling) {
    s.number(coupling.driving);
    s.number(coupling.driven);
    s.number(coupling.ratio);
  });
  for (double* value :
       {&sums.observation.cutoff, &sums.observation.rows_per_cutoff, &sums.observation.standstill_speed})
    s.number(*value);
  items(s, sums.logs, sizeof(LogShare::key), [&](LogShare& log) { log_share(s, log); });
}

}  // namespace

std::string to_bytes(const Sums& sums) {
  Writer writer;
  Sums copy = sums;  // one description serves both directions, and reading writes
  settings(writer, copy);
  write_factors(writer, sums.factors);
  std::string bytes(kMagic);
  bytes.append(reinterpret_cast<const char*>(&kVersion), sizeof kVersion);
  bytes += writer.take();
  const std::uint64_t hash = host::hash_of(bytes);
  return bytes.append(reinterpret_cast<const char*>(&hash), sizeof hash);
}

Sums sums_from_bytes(std::string_view bytes, const std::string& name) {
  if (bytes.size() < kMagic.size() + sizeof kVersion + kHash || bytes.substr(0, kMagic.size()) != kMagic) {
    throw DataError(fmt::format("{}: found {} bytes that are no sums; expected sums as heft writes them",
                                name, bytes.size()));
  }
  std::uint32_t version = 0;
  std::memcpy(&version, bytes.data() + kMagic.size(), sizeof version);
  if (version != kVersion) {
    throw DataError(fmt::format(
        "{}: found version {} of sums; expected version {}; make them again with this version of heft", name,
        version, kVersion));
  }
  std::uint64_t hash = 0;
  std::memcpy(&hash, bytes.data() + bytes.size() - kHash, kHash);
  if (hash != host::hash_of(bytes.substr(0, bytes.size() - kHash))) {
    throw DataError(
        fmt::format("{}: found {} bytes that were cut or changed on the way; send or write the sums again",
                    name, bytes.size()));
  }
  bytes.remove_suffix(kHash);
  bytes.remove_prefix(kMagic.size() + sizeof version);
  Reader reader(bytes, name);
  Sums sums;
  settings(reader, sums);
  sums.factors = read_factors(reader);
  reader.end();
  for (const LogShare& log : sums.logs) {
    for (const Eigen::VectorXd* values :
         {&log.summary.travel, &log.summary.top_speed, &log.summary.max_torque, &log.correlation_time})
      if (values->size() != sums.factors.num_joints()) reader.refuse();
  }
  return sums;
}

}  // namespace heft::identify
