// The server has answered the address with its token by a cookie: from here on the token need not be seen any more,
// neither in the address bar nor in the history.
export function hide_token(): void {
  const address = new URL(location.href);
  if (!address.searchParams.has('token')) return;
  address.searchParams.delete('token');
  history.replaceState(null, '', address);
}
