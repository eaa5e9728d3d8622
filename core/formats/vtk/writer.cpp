#include "core/formats/vtk/writer.h"

#include <libdeflate.h>
#include <vtkAbstractArray.h>
#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDataArray.h>
#include <vtkErrorCode.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkUnstructuredGrid.h>
#include <vtkUnstructuredGridWriter.h>
#include <vtkXMLUnstructuredGridWriter.h>
#include <vtkZLibDataCompressor.h>

#include <algorithm>
#include <exception>
#include <memory>
#include <new>
#include <span>
#include <streambuf>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/errors.h"
#include "core/formats/mesh_format.h"
#include "core/formats/vtk/messages.h"
#include "core/parallel.h"
#include "core/temporary_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

/// Stream buffer onto a TemporaryFile. It keeps the first failure and goes on as if nothing were:
/// VTK's writer misses some failed writes, and crashes on others.
class FileBuffer : public std::streambuf {
 public:
  explicit FileBuffer(TemporaryFile& file) : file_(file), buffer_(1 << 20) { reset(); }

  /// Writes out what is left; throws the first failure of all.
  void finish() {
    flush();
    if (failure_) std::rethrow_exception(failure_);
  }

 protected:
  int_type overflow(int_type c) override {
    flush();
    if (!traits_type::eq_int_type(c, traits_type::eof())) sputc(traits_type::to_char_type(c));
    return traits_type::not_eof(c);
  }
  std::streamsize xsputn(const char* data, std::streamsize size) override {
    if (size > epptr() - pptr()) flush();
    if (size > epptr() - pptr()) {
      put(data, size);
      return size;
    }
    std::copy_n(data, size, pptr());
    pbump(static_cast<int>(size));
    return size;
  }
  pos_type seekoff(off_type offset, std::ios::seekdir from, std::ios::openmode) override {
    const off_type here = start_ + (pptr() - pbase());
    end_ = std::max(end_, here);
    const off_type place = offset + (from == std::ios::beg   ? 0
                                     : from == std::ios::cur ? here
                                                             : end_);
    if (place == here) return place;
    flush();
    start_ = place;
    return place;
  }
  pos_type seekpos(pos_type place, std::ios::openmode mode) override {
    return seekoff(place, std::ios::beg, mode);
  }

 private:
  void reset() { setp(buffer_.data(), buffer_.data() + buffer_.size()); }
  void flush() {
    put(pbase(), pptr() - pbase());
    reset();
  }
  void put(const char* data, std::streamsize size) {
    try {
      if (!failure_) file_.write(data, static_cast<std::size_t>(size), start_);
    } catch (const IoError&) {
      failure_ = std::current_exception();
    }
    start_ += size;
    end_ = std::max(end_, start_);
  }

  TemporaryFile& file_;
  std::vector<char> buffer_;
  off_type start_ = 0;  ///< place of the buffer's first character
  off_type end_ = 0;
  std::exception_ptr failure_;
};

/// VTK's writer, onto a stream buffer of ours.
class BufferWriter : public vtkXMLUnstructuredGridWriter {
 public:
  static BufferWriter* New();
  void set_buffer(std::streambuf* buffer) {
    buffer_ = buffer;
    WriteToOutputStringOn();
  }

 protected:
  int StartFile() override {
    Stream->rdbuf(buffer_);
    return vtkXMLUnstructuredGridWriter::StartFile();
  }

 private:
  std::streambuf* buffer_ = nullptr;
};
vtkStandardNewMacro(BufferWriter);

struct FreeCompressor {
  void operator()(libdeflate_compressor* one) const { libdeflate_free_compressor(one); }
};

/// zlib's format from libdeflate: for meshes as small as VTK's own, in a sixth of the time. VTK
/// hands over one block after the other; those of arrays known beforehand are compressed on all
/// threads, some ahead.
class FastZlib : public vtkZLibDataCompressor {
 public:
  static FastZlib* New();

  void set_arrays_of(vtkUnstructuredGrid* grid) {
    add(grid->GetPoints() ? grid->GetPoints()->GetData() : nullptr);
    add(grid->GetCells()->GetConnectivityArray());
    for (vtkFieldData* data : {static_cast<vtkFieldData*>(grid->GetPointData()),
                               static_cast<vtkFieldData*>(grid->GetCellData())})
      for (int i = 0; i < data->GetNumberOfArrays(); ++i)
        add(vtkDataArray::SafeDownCast(data->GetAbstractArray(i)));
  }

  size_t GetMaximumCompressionSpace(size_t size) override {
    return libdeflate_zlib_compress_bound(nullptr, size);
  }

 protected:
  size_t CompressBuffer(const unsigned char* data, size_t size, unsigned char* compressed,
                        size_t) override {
    const Bytes block(data, size);
    if (!is_ahead(block)) compress_from(block);
    const auto& one = ahead_[std::size_t(data - first_.data()) / size];
    std::ranges::copy(one, compressed);
    return one.size();
  }

 private:
  using Bytes = std::span<const unsigned char>;
  static constexpr int kLevel = 1;  // higher ones take a percent off points and connectivity
  static constexpr std::size_t kAhead = 64;  // blocks: four for each of 16 threads

  void add(vtkDataArray* array) {
    if (array && array->HasStandardMemoryLayout())
      arrays_.emplace_back(static_cast<const unsigned char*>(array->GetVoidPointer(0)),
                           std::size_t(array->GetNumberOfValues() * array->GetDataTypeSize()));
  }

  // The bytes of a known array from the block's first on; none where VTK made a copy, which the
  // next one takes the place of.
  std::size_t known_from(Bytes block) const {
    for (const Bytes& array : arrays_)
      if (block.data() >= array.data() && block.data() < array.data() + array.size())
        return std::size_t(array.data() + array.size() - block.data());
    return 0;
  }

  bool is_ahead(Bytes block) const {
    const auto from_first = block.data() - first_.data();
    return block.size() == first_.size() && from_first >= 0 && known_from(block) > 0 &&
           std::size_t(from_first) % first_.size() == 0 &&
           std::size_t(from_first) / first_.size() < ahead_.size();
  }

  void compress_from(Bytes block) {
    first_ = block;
    ahead_.resize(std::clamp<std::size_t>(
        known_from(block) / std::max<std::size_t>(block.size(), 1), 1, kAhead));
    parallel_for(std::ssize(ahead_), 4, [&](Index begin, Index end) {
      const std::unique_ptr<libdeflate_compressor, FreeCompressor> compressor(
          libdeflate_alloc_compressor(kLevel));
      if (!compressor) throw std::bad_alloc();
      for (Index i = begin; i < end; ++i) {
        const Bytes from(block.data() + std::size_t(i) * block.size(), block.size());
        auto& one = ahead_[std::size_t(i)];
        one.resize(libdeflate_zlib_compress_bound(compressor.get(), from.size()));
        one.resize(libdeflate_zlib_compress(compressor.get(), from.data(), from.size(), one.data(),
                                            one.size()));
      }
    });
  }

  std::vector<Bytes> arrays_;
  Bytes first_;                                    ///< block of those that are compressed
  std::vector<std::vector<unsigned char>> ahead_;  ///< from that on
};
vtkStandardNewMacro(FastZlib);

/// Blocks of more than 4 GiB need long headers, whatever the input had.
bool needs_long_headers(vtkUnstructuredGrid* grid) {
  constexpr unsigned long kKibibytes = 1ul << 21;  // 2 GiB in all: no block is near 4 GiB
  return grid->GetActualMemorySize() > kKibibytes;
}

template <class Writer>
void run_writer(Writer* writer, const fs::path& target) {
  SilentVtk vtk;
  const bool is_written = writer->Write() != 0;
  if (!is_written || vtk.has_errors() || writer->GetErrorCode() != vtkErrorCode::NoError)
    fail_writing(target, vtk.first_error());
}

/// VTK 9.1 writes names of arrays into its XML as they are, and its reader takes the first '>' for
/// the end of a tag.
std::string for_xml(std::string_view name) {
  std::string text;
  for (const char c : name) {
    if (c == '&')
      text += "&amp;";
    else if (c == '<')
      text += "&lt;";
    else if (c == '>')
      text += "&gt;";
    else if (c == '"')
      text += "&quot;";
    else
      text += c;
  }
  return text;
}

/// The arrays with such names, for as long as it lives.
class NamesForXml {
 public:
  explicit NamesForXml(vtkUnstructuredGrid* grid) {
    for (vtkFieldData* data :
         {static_cast<vtkFieldData*>(grid->GetPointData()),
          static_cast<vtkFieldData*>(grid->GetCellData()), grid->GetFieldData()})
      for (int i = 0; i < data->GetNumberOfArrays(); ++i) {
        vtkAbstractArray* array = data->GetAbstractArray(i);
        const std::string name = array->GetName() ? array->GetName() : "";
        if (for_xml(name) == name) continue;
        old_.emplace_back(array, name);
        array->SetName(for_xml(name).c_str());
      }
  }
  ~NamesForXml() {
    for (const auto& [array, name] : old_) array->SetName(name.c_str());
  }
  NamesForXml(const NamesForXml&) = delete;
  NamesForXml& operator=(const NamesForXml&) = delete;

 private:
  std::vector<std::pair<vtkAbstractArray*, std::string>> old_;
};

void write_xml(vtkUnstructuredGrid* grid, const Layout& layout, const fs::path& target,
               TemporaryFile& file) {
  const NamesForXml names(grid);
  FileBuffer buffer(file);
  vtkNew<BufferWriter> writer;
  writer->set_buffer(&buffer);
  writer->SetInputData(grid);
  writer->SetDataMode(layout.data_mode);
  vtkNew<FastZlib> compressor;
  compressor->set_arrays_of(grid);
  if (layout.compressor == vtkXMLWriter::ZLIB)
    writer->SetCompressor(compressor);
  else
    writer->SetCompressorType(layout.compressor);
  writer->SetEncodeAppendedData(layout.is_appended_base64);
  writer->SetHeaderType(layout.has_long_headers || needs_long_headers(grid) ? vtkXMLWriter::UInt64
                                                                            : vtkXMLWriter::UInt32);
  run_writer(writer.Get(), target);
  buffer.finish();
}

void write_legacy(vtkUnstructuredGrid* grid, const Layout& layout, const fs::path& target,
                  TemporaryFile& file) {
  vtkNew<vtkUnstructuredGridWriter> writer;
  writer->SetInputData(grid);
  writer->SetFileTypeToBinary();  // VTK writes but 11 digits in ascii
  writer->SetFileVersion(layout.legacy_version);
  writer->WriteToOutputStringOn();
  run_writer(writer.Get(), target);
  file.write(writer->GetOutputString(), static_cast<std::size_t>(writer->GetOutputStringLength()),
             0);
}

}  // namespace

void write_grid(vtkUnstructuredGrid* grid, const Layout& layout, const fs::path& path) {
  TemporaryFile file(path);
  const bool is_xml = path.extension() == ".vtu" || (layout.is_xml && path.extension() != ".vtk");
  if (is_xml)
    write_xml(grid, layout, path, file);
  else
    write_legacy(grid, layout, path, file);
  file.commit();
}

}  // namespace cadmorph
