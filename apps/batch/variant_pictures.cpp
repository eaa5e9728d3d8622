#include "apps/batch/variant_pictures.h"

#include <system_error>

#include "apps/pipeline/output_file.h"
#include "core/length_units.h"

namespace cadmorph {

namespace fs = std::filesystem;

void VariantPictures::draw(const std::string& id, const MorphResult& result) {
  finish();
  std::error_code error;
  fs::create_directories(folder_, error);
  fs::remove(file_of(id), error);  // of an earlier run
  drawn_ = id;
  const DrawnMesh drawn{.mesh = result.base->mesh(),
                        .neighbours = result.base->neighbours,
                        .before = result.base->quality,
                        .moved = &result.positions,
                        .after = &result.quality,
                        .unit = unit_name(result.report.mesh.unit_mm)};
  drawing_ = std::make_unique<PictureProcess>(drawn, std::vector{thumbnail(drawn)});
}

void VariantPictures::finish() {
  if (!drawing_) return;
  const auto drawing = std::move(drawing_);
  const DrawnPictures pictures = drawing->wait();
  if (pictures.failure.empty())
    write_text(file_of(drawn_), pictures.bytes.begin()->second);
  else
    failure_ = pictures.failure;
}

std::string VariantPictures::read(const std::string& id) const {
  std::error_code error;
  return fs::is_regular_file(file_of(id), error) ? read_bytes(file_of(id)) : "";
}

}  // namespace cadmorph
