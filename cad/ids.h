#pragma once

#include "core/id.h"

namespace cadmorph {

using VertexId = Id<struct CadVertex>;  ///< of CadModel::vertices
using EdgeId = Id<struct CadEdge>;      ///< of CadModel::edges
using CoedgeId = Id<struct CadCoedge>;  ///< of CadModel::coedges
using FaceId = Id<struct CadFace>;      ///< of CadModel::faces
using CurveId = Id<struct CadCurve>;    ///< of CadSkeleton::curves
using CornerId = Id<struct CadCorner>;  ///< of CadSkeleton::corners

}  // namespace cadmorph
