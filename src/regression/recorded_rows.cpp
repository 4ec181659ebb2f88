#include "heft/regression/recorded_rows.hpp"

#include "heft/host/error.hpp"

namespace heft::regression {

void RecordedRows::add(const ObservationRows& rows) {
  Piece piece{rows.log, rows.joint, rows.time.size(), rows.W.cols(), {}};
  const auto put = [&](const double* column) {
    numbers_.append({column, static_cast<std::size_t>(piece.rows)});
  };
  put(rows.time.data());
  put(rows.tau.data());
  for (Eigen::Index c = 0; c < piece.columns; ++c) {
    if ((rows.W.col(c).array() == 0.0).all()) continue;
    piece.filled.push_back(static_cast<int>(c));
    put(rows.W.col(c).data());
  }
  pieces_.push_back(std::move(piece));
}

bool RecordedRows::Pass::next(ObservationRows& rows) {
  while (piece_ < rows_.pieces_.size() && joint_ >= 0 && rows_.pieces_[piece_].joint != joint_) {
    const Piece& other = rows_.pieces_[piece_++];
    at_ += (2 + other.filled.size()) * static_cast<std::size_t>(other.rows);
  }
  if (piece_ == rows_.pieces_.size()) return false;
  const Piece& piece = rows_.pieces_[piece_++];
  bool read = true;
  const auto get = [&](double* column) {
    read = read && rows_.numbers_.read(at_, {column, static_cast<std::size_t>(piece.rows)});
    at_ += static_cast<std::size_t>(piece.rows);
  };
  rows.log = piece.log;
  rows.joint = piece.joint;
  rows.time.resize(piece.rows);
  rows.tau.resize(piece.rows);
  rows.W = Eigen::MatrixXd::Zero(piece.rows, piece.columns);
  rows.Z.resize(0, 0);
  get(rows.time.data());
  get(rows.tau.data());
  for (const int column : piece.filled) get(rows.W.col(column).data());
  if (!read) throw DataError("a temporary file of rows cannot be read; check the disk of TMPDIR");
  return true;
}

}  // namespace heft::regression
