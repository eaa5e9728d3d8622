# Morphs MESH from BASE to VARIANT with PROGRAM and compares the result with REFERENCE.
#
# The results of two processors differ in rounding, which the interpolation matrix amplifies to some
# 1e-9 of an edge, and the fast solver leaves residuals of 1e-5 of an edge: TOLERANCE is between.
# What optimisation raises is left out: where it ends depends on rounding.
execute_process(COMMAND ${PROGRAM} ${BASE} ${VARIANT} ${MESH} -o ${OUTPUT} --quality fast --quiet
  COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${PROGRAM} compare ${REFERENCE} ${OUTPUT} --tolerance ${TOLERANCE}
  COMMAND_ERROR_IS_FATAL ANY)
file(REMOVE ${OUTPUT})
