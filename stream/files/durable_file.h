/// \file durable_file.h
/// What a commit is made of: sync, rename, hash. A full disk is a ResourceError wherever it shows.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

namespace tessera {

/// \throws UsageError     when `error` (an errno) says that this place cannot be written at all
/// \throws ResourceError  for the rest: full disk or quota, a disk that fails; names file and the system's reason
[[noreturn]] void throw_write_error(const std::filesystem::path& path, int error);

/// Writes all of it at an offset, past interruptions and short writes. \returns 0, or what errno says: ENOSPC where
/// nothing more is taken
int write_all_at(int fd, const void* data, std::uint64_t bytes, std::uint64_t offset);

/// XXH3 (64 bits) of a file's content, read through a small buffer. \throws InputError
std::uint64_t hash_file(const std::filesystem::path& path);

/// 16 lower-case hex digits.
std::string hex64(std::uint64_t value);
/// XXH3 of bytes in memory.
std::uint64_t hash_bytes(const void* data, std::size_t bytes);
std::uint64_t hash_text(const std::string& text);

/// Forces a file's content, or a folder's names, to the disk.
void sync_file(const std::filesystem::path& path);
void sync_folder(const std::filesystem::path& path);

/// Creates output_aside(path) (planned_writes.h) anew for this process alone and locks it while it is open, so that of two
/// processes with one output the second is told. No link is followed, nothing that is there is opened for writing.
/// \returns a descriptor \throws UsageError when another process has it, or it cannot be created
int create_aside(const std::filesystem::path& path);

/// Whether `path` is the very file that `fd` has open: another machine, which does not see the lock of an aside, may have
/// taken it for a leftover and begun its own.
bool names_file(const std::filesystem::path& path, int fd);

/// Makes `path` hold `text`: at no moment, killed or not, does it hold anything but its old or its new
/// content.
void write_durably(const std::filesystem::path& path, const std::string& text);

/// Makes a file of a task hold `text`, not forced to the disk: who commits it does that (runtime/commit.h).
void write_text(const std::filesystem::path& path, const std::string& text);

/// Renames and syncs the folder.
void rename_durably(const std::filesystem::path& from, const std::filesystem::path& to);

/// The whole of a small text file. \throws InputError
std::string read_text(const std::filesystem::path& path);

}  // namespace tessera
