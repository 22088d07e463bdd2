{{/* What the pods of all servers have in common. */}}

{{- define "varimesh.pod" -}}
serviceAccountName: varimesh
automountServiceAccountToken: false
securityContext:
  {runAsNonRoot: true, runAsUser: 65532, runAsGroup: 65532, {{ if . }}fsGroup: 65532, fsGroupChangePolicy: OnRootMismatch, {{ end }}seccompProfile: {type: RuntimeDefault}}
{{- end }}

{{- define "varimesh.container" -}}
name: varimeshd
{{- with .Values.image }}
image: "{{ .repository }}{{ if .digest }}@{{ .digest }}{{ else }}:{{ .tag }}{{ end }}"
{{- end }}
envFrom: [{configMapRef: {name: varimesh}}]
env:
  - {name: PGPASSWORD, valueFrom: {secretKeyRef: {name: {{ .Values.database.secret }}, key: password}}}
{{- if .Values.meshes.bucket }}
  - {name: AWS_SHARED_CREDENTIALS_FILE, value: /bucket/credentials}
{{- end }}
securityContext: {allowPrivilegeEscalation: false, readOnlyRootFilesystem: true, capabilities: {drop: [ALL]}}
{{- end }}

{{- define "varimesh.probes" -}}
startupProbe: {httpGet: {path: /healthz/live, port: metrics}, periodSeconds: 1, failureThreshold: 60}
readinessProbe: {httpGet: {path: /healthz/ready, port: metrics}, periodSeconds: 5}
livenessProbe: {httpGet: {path: /healthz/live, port: metrics}, periodSeconds: 10, timeoutSeconds: 5}
{{- end }}

{{- define "varimesh.mounts" -}}
{{- if .Values.meshes.bucket }}
- {name: bucket, mountPath: /bucket, readOnly: true}
{{- else }}
- {name: meshes, mountPath: /volume}
{{- end }}
- {name: tmp, mountPath: /tmp}
{{- end }}

{{- define "varimesh.volumes" -}}
{{- if .Values.meshes.bucket }}
- {name: bucket, secret: {secretName: {{ .Values.meshes.secret }}, defaultMode: 0440}}
{{- else }}
- {name: meshes, persistentVolumeClaim: {claimName: varimesh-meshes}}
{{- end }}
- {name: tmp, emptyDir: {}}
{{- end }}
