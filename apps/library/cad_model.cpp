#include "apps/library/impl.h"
#include "cad/brep_reader.h"
#include "cad/step_reader.h"

namespace cadmorph::v1 {
namespace {

// OCCT's readers have one state for all.
template <class Read>
CadModel read(const Read& read_model) {
  static std::mutex reading;
  return at_door([&] {
    const std::lock_guard lock(reading);
    return CadModel(std::make_shared<const CadModel::Impl>(
        std::make_shared<const cadmorph::CadModel>(read_model())));
  });
}

}  // namespace

CadModel::CadModel(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

CadModel CadModel::from_step(const std::filesystem::path& path) {
  return read([&] { return read_step(path); });
}

CadModel CadModel::from_step_bytes(std::string_view bytes, const std::string& name) {
  return read([&] { return read_step_bytes(bytes, name); });
}

CadModel CadModel::from_brep_bytes(std::string_view bytes, const std::string& name) {
  return read([&] { return read_brep(bytes, name); });
}

const std::string& CadModel::name() const { return impl_->model->file_name(); }
const std::string& CadModel::unit() const { return impl_->model->file_unit(); }
Index CadModel::face_count() const { return std::ssize(impl_->model->faces()); }
Index CadModel::edge_count() const { return std::ssize(impl_->model->edges()); }
Index CadModel::vertex_count() const { return std::ssize(impl_->model->vertices()); }
int CadModel::solid_count() const { return impl_->model->solid_count(); }
Eigen::Vector3d CadModel::lower_mm() const { return impl_->model->lower(); }
Eigen::Vector3d CadModel::upper_mm() const { return impl_->model->upper(); }
double CadModel::diagonal_mm() const { return impl_->model->diagonal(); }

}  // namespace cadmorph::v1
