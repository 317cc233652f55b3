/// \file written_hash.h
/// The XXH3 of files, kept while they are written from start to end: who commits one need not read all of it again, which past
/// the page cache is from the disk.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>

namespace tessera {

/// The empty file that is open as `fd` will be written from its start, every byte once. From any thread, as those below.
void begin_written_hash(int fd);
/// The next bytes of it. Nothing happens for a descriptor without hash.
void add_to_written_hash(int fd, const void* data, std::size_t bytes);
/// Something else is done to it: it has no hash from here on. Before a descriptor is closed that was begun and not kept.
void drop_written_hash(int fd);
/// It is whole; hash_written_file() finds what was added.
void keep_written_hash(int fd);

/// What hash_file() gives: as this process wrote the file, where it kept that and nobody wrote to the file since (by inode,
/// size and time of the last change); else the file is read. \throws InputError as hash_file()
std::uint64_t hash_written_file(const std::filesystem::path& path);

}  // namespace tessera
