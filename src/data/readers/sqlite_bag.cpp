/// @file
/// rosbag2's SQLite: tables `topics(id, name, type, serialization_format, ...)` and `messages(id, topic_id, timestamp,
/// data)`. SQLite gets the file through functions of ours that read and never write: no journal appears beside the
/// recording, and files without a name (pipes, decompressed ones) are read as well.
#include <algorithm>
#include <filesystem>
#include <memory>

#include <sqlite3.h>

#include "bag.hpp"

namespace heft::data {
namespace {

/// A file as SQLite sees it. SQLite takes the memory and knows the first member only.
struct SqliteFile {
  sqlite3_file base;
  const InputBytes* bytes;
};

/// The file that is being opened; SQLite opens it inside sqlite3_open_v2, in the same thread.
thread_local const InputBytes* sqlite_opens = nullptr;

int sqlite_close(sqlite3_file*) { return SQLITE_OK; }
int sqlite_read(sqlite3_file* file, void* to, int count, sqlite3_int64 at) {
  const InputBytes& bytes = *reinterpret_cast<SqliteFile*>(file)->bytes;
  std::size_t got = 0;
  try {
    got = bytes.read_some(static_cast<std::uint64_t>(at), to, static_cast<std::size_t>(count));
  } catch (const Error&) {
    return SQLITE_IOERR_READ;
  }
  if (got == static_cast<std::size_t>(count)) return SQLITE_OK;
  std::memset(static_cast<char*>(to) + got, 0, static_cast<std::size_t>(count) - got);
  return SQLITE_IOERR_SHORT_READ;
}
int sqlite_write(sqlite3_file*, const void*, int, sqlite3_int64) { return SQLITE_READONLY; }
int sqlite_truncate(sqlite3_file*, sqlite3_int64) { return SQLITE_READONLY; }
int sqlite_sync(sqlite3_file*, int) { return SQLITE_OK; }
int sqlite_size(sqlite3_file* file, sqlite3_int64* size) {
  *size = static_cast<sqlite3_int64>(reinterpret_cast<SqliteFile*>(file)->bytes->size());
  return SQLITE_OK;
}
int sqlite_lock(sqlite3_file*, int) { return SQLITE_OK; }
int sqlite_is_locked(sqlite3_file*, int* locked) {
  *locked = 0;
  return SQLITE_OK;
}
int sqlite_control(sqlite3_file*, int, void*) { return SQLITE_NOTFOUND; }
int sqlite_sector(sqlite3_file*) { return 4096; }
int sqlite_kind(sqlite3_file*) { return SQLITE_IOCAP_IMMUTABLE; }

const sqlite3_io_methods& sqlite_methods() {
  static const sqlite3_io_methods methods = [] {
    sqlite3_io_methods table{};
    table.iVersion = 1;
    table.xClose = sqlite_close;
    table.xRead = sqlite_read;
    table.xWrite = sqlite_write;
    table.xTruncate = sqlite_truncate;
    table.xSync = sqlite_sync;
    table.xFileSize = sqlite_size;
    table.xLock = sqlite_lock;
    table.xUnlock = sqlite_lock;
    table.xCheckReservedLock = sqlite_is_locked;
    table.xFileControl = sqlite_control;
    table.xSectorSize = sqlite_sector;
    table.xDeviceCharacteristics = sqlite_kind;
    return table;
  }();
  return methods;
}

int sqlite_open_file(sqlite3_vfs*, const char*, sqlite3_file* file, int flags, int* out_flags) {
  file->pMethods = nullptr;
  if ((flags & SQLITE_OPEN_MAIN_DB) == 0 || sqlite_opens == nullptr) return SQLITE_CANTOPEN;
  reinterpret_cast<SqliteFile*>(file)->bytes = sqlite_opens;
  file->pMethods = &sqlite_methods();
  if (out_flags != nullptr) *out_flags = SQLITE_OPEN_READONLY | SQLITE_OPEN_MAIN_DB;
  return SQLITE_OK;
}
int sqlite_access(sqlite3_vfs*, const char*, int, int* there) {
  *there = 0;
  return SQLITE_OK;
}
int sqlite_full_path(sqlite3_vfs*, const char* name, int room, char* full) {
  sqlite3_snprintf(room, full, "%s", name);
  return SQLITE_OK;
}

constexpr const char* kSqliteFiles = "heft-read-only";

/// Makes the functions above known to SQLite, once. @return whether they are
bool register_sqlite_files() {
  static const bool done = [] {
    sqlite3_vfs* const usual = sqlite3_vfs_find(nullptr);  // brings the library up
    if (usual == nullptr) return false;
    static sqlite3_vfs files = *usual;  // clock, random numbers and sleep as usual
    files.iVersion = 1;
    files.szOsFile = sizeof(SqliteFile);
    files.pNext = nullptr;
    files.zName = kSqliteFiles;
    files.xOpen = sqlite_open_file;
    files.xAccess = sqlite_access;
    files.xFullPathname = sqlite_full_path;
    return sqlite3_vfs_register(&files, 0) == SQLITE_OK;
  }();
  return done;
}

struct CloseSqlite {
  void operator()(sqlite3* database) const { sqlite3_close(database); }
};
struct FinishSqlite {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using SqliteStatement = std::unique_ptr<sqlite3_stmt, FinishSqlite>;

class SqliteSource final : public MessageSource {
 public:
  explicit SqliteSource(SharedBytes file);

  const std::string& path() const override { return file_->path(); }
  std::string format() const override { return "rosbag2 (SQLite)"; }
  std::vector<BagTopic> topics(bool counted) override;
  void choose(const std::string& topic) override;
  bool next(BagMessage& message) override;
  double part_read() const override { return part_; }
  std::vector<std::string> notes() const override;

 private:
  SqliteStatement prepare(const std::string& text) const;
  /// Goes to the next row. @return false behind the last
  bool step(sqlite3_stmt* statement) const;
  [[noreturn]] void fail(std::string_view doing) const {
    throw DataError(
        fmt::format("{}: {} failed ({}); expected a recording of rosbag2 in SQLite; the file is damaged; "
                    "try '.recover' of sqlite3",
                    path(), doing, sqlite3_errmsg(database_.get())));
  }
  void read_topics();
  void count_messages();
  static std::string text_of(sqlite3_stmt* statement, int column) {
    const auto* const text = reinterpret_cast<const char*>(sqlite3_column_text(statement, column));
    return text == nullptr
               ? ""
               : std::string(text, static_cast<std::size_t>(sqlite3_column_bytes(statement, column)));
  }

  SharedBytes file_;
  std::unique_ptr<sqlite3, CloseSqlite> database_;
  SqliteStatement messages_;
  bool by_time_{false};  ///< an index gives them in order of time; otherwise that of recording is taken
  std::vector<std::pair<sqlite3_int64, BagTopic>> topics_;
  bool counted_{false};
  double last_row_{0.0};
  double part_{0.0};
};

SqliteSource::SqliteSource(SharedBytes file) : file_(std::move(file)) {
  if (!register_sqlite_files()) throw DataError(path() + ": SQLite does not start; install it again");
  sqlite3* database = nullptr;
  sqlite_opens = file_.get();
  const int result = sqlite3_open_v2("bag", &database, SQLITE_OPEN_READONLY, kSqliteFiles);
  database_.reset(database);
  if (result != SQLITE_OK) {
    sqlite_opens = nullptr;
    fail("opening it");
  }
  // The schema is not to be trusted: no functions of views and triggers, nothing larger than a message can be.
  sqlite3_db_config(database, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(database, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_limit(database, SQLITE_LIMIT_LENGTH, 1 << 28);
  sqlite3_limit(database, SQLITE_LIMIT_VDBE_OP, 25000);
  sqlite3_exec(database, "PRAGMA cell_size_check = ON; PRAGMA mmap_size = 0; PRAGMA temp_store = MEMORY",
               nullptr, nullptr, nullptr);
  read_topics();
  sqlite_opens = nullptr;
}

SqliteStatement SqliteSource::prepare(const std::string& text) const {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(database_.get(), text.c_str(), -1, &statement, nullptr) != SQLITE_OK) {
    fail("reading its tables");
  }
  return SqliteStatement(statement);
}

bool SqliteSource::step(sqlite3_stmt* statement) const {
  const int result = sqlite3_step(statement);
  if (result != SQLITE_ROW && result != SQLITE_DONE) fail("reading its rows");
  return result == SQLITE_ROW;
}

void SqliteSource::read_topics() {
  const SqliteStatement tables =
      prepare("SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages')");
  if (!step(tables.get()) || sqlite3_column_int(tables.get(), 0) != 2) {
    throw DataError(
        fmt::format("{}: found an SQLite file without the tables 'topics' and 'messages'; expected a "
                    "recording of rosbag2; export it to CSV",
                    path()));
  }
  const SqliteStatement indexed = prepare(
      "SELECT count(*) FROM sqlite_master WHERE type = 'index' AND tbl_name = 'messages' AND sql LIKE '%(timestamp%'");
  by_time_ = step(indexed.get()) && sqlite3_column_int(indexed.get(), 0) > 0;
  const SqliteStatement rows =
      prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY name");
  while (step(rows.get())) {
    BagTopic topic;
    topic.name = text_of(rows.get(), 1);
    topic.type = text_of(rows.get(), 2);
    topic.encoding = text_of(rows.get(), 3);
    topics_.emplace_back(sqlite3_column_int64(rows.get(), 0), std::move(topic));
  }
  const SqliteStatement last = prepare("SELECT max(rowid) FROM messages");
  if (step(last.get())) last_row_ = sqlite3_column_double(last.get(), 0);
}

void SqliteSource::count_messages() {
  const SqliteStatement rows =
      prepare("SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages GROUP BY topic_id");
  while (step(rows.get())) {
    for (auto& [id, topic] : topics_) {
      if (id != sqlite3_column_int64(rows.get(), 0)) continue;
      topic.messages =
          static_cast<std::uint64_t>(std::max<sqlite3_int64>(0, sqlite3_column_int64(rows.get(), 1)));
      topic.first = sqlite3_column_int64(rows.get(), 2);
      topic.last = sqlite3_column_int64(rows.get(), 3);
    }
  }
  counted_ = true;
}

std::vector<BagTopic> SqliteSource::topics(bool counted) {
  const auto states = std::count_if(topics_.begin(), topics_.end(),
                                    [](const auto& each) { return each.second.holds_joint_states(); });
  if (!counted_ && (counted || states > 1)) count_messages();
  std::vector<BagTopic> list;
  for (const auto& [id, topic] : topics_) list.push_back(topic);
  return list;
}

void SqliteSource::choose(const std::string& topic) {
  std::string ids;  // a topic that was announced twice has two
  for (const auto& [id, each] : topics_) {
    if (each.name == topic) ids += fmt::format("{}{}", ids.empty() ? "" : ", ", id);
  }
  messages_ =
      prepare(fmt::format("SELECT rowid, timestamp, data FROM messages WHERE +topic_id IN ({}) ORDER BY {}",
                          ids, by_time_ ? "timestamp" : "rowid"));
  part_ = 0.0;
}

bool SqliteSource::next(BagMessage& message) {
  if (!step(messages_.get())) {
    part_ = 1.0;
    return false;
  }
  const sqlite3_int64 row = sqlite3_column_int64(messages_.get(), 0);
  message.recorded = sqlite3_column_int64(messages_.get(), 1);
  const void* const data = sqlite3_column_blob(messages_.get(), 2);
  const int count = sqlite3_column_bytes(messages_.get(), 2);
  message.data = data == nullptr
                     ? std::string_view()
                     : std::string_view(static_cast<const char*>(data), static_cast<std::size_t>(count));
  message.at = static_cast<std::uint64_t>(row);
  part_ = last_row_ > 0.0 ? std::clamp(static_cast<double>(row) / last_row_, 0.0, 1.0) : 0.0;
  return true;
}

std::vector<std::string> SqliteSource::notes() const {
  std::error_code ignored;
  const auto size = std::filesystem::file_size(path() + "-wal", ignored);
  if (ignored || size == 0) return {};
  return {
      fmt::format("the recording was not closed: what is in '{}-wal' was not read; open it once with sqlite3 "
                  "to join them",
                  path())};
}

}  // namespace

bool recognises_sqlite(std::string_view head) {
  return head.starts_with(std::string_view("SQLite format 3\0", 16));
}

std::unique_ptr<MessageSource> open_sqlite_bag(SharedBytes file) {
  return std::make_unique<SqliteSource>(std::move(file));
}

}  // namespace heft::data
