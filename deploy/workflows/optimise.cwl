#!/usr/bin/env cwl-runner
# One step of a CWL workflow: cwltool --no-container optimise.cwl --mesh in.msh --server HOST:PORT
cwlVersion: v1.2
class: CommandLineTool
label: Optimise a high-order mesh
baseCommand: [varimesh, optimise]
requirements:
  NetworkAccess:
    networkAccess: true
inputs:
  mesh:
    type: File
    inputBinding: {position: 1}
  server:
    type: string?
    doc: HOST:PORT or unix:PATH; without one the command does the work itself
    inputBinding: {prefix: --server}
  request_id:
    type: string?
    doc: Repeating with the same one joins the same job
    inputBinding: {prefix: --request-id}
  energy:
    type: string
    default: hyperelastic
    inputBinding: {prefix: --energy}
  name:
    type: string
    default: optimised
arguments:
  - {prefix: --output, valueFrom: $(inputs.name).msh}
  - {prefix: --output, valueFrom: $(inputs.name).vtu}
  - --json
# 4: done, but some elements are not certified valid, which `quality` tells; add it to successCodes where that will do.
successCodes: [0]
temporaryFailCodes: [5]
permanentFailCodes: [1, 2, 3, 4]
stdout: $(inputs.name).json
outputs:
  msh: {type: File, outputBinding: {glob: $(inputs.name).msh}}
  vtu: {type: File, outputBinding: {glob: $(inputs.name).vtu}}
  quality: {type: stdout}
